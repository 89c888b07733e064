#include "render.hpp"

#include "parallel.hpp"

namespace goshawk {
namespace {

struct Sensor {
    const double* rays;
    int height, width;
    Vec3 ray(int row, int column) const {
        const double* r = rays + 3 * (static_cast<std::size_t>(row) * width + column);
        return {r[0], r[1], r[2]};
    }
    // Change of the ray per pixel along the row and along the column; a one-sided difference at the edge of the field
    // of view and of the image.
    Vec3 right(int row, int column) const {
        return change(ray(row, column), column + 1 < width ? ray(row, column + 1) : outside,
                      column > 0 ? ray(row, column - 1) : outside);
    }
    Vec3 down(int row, int column) const {
        return change(ray(row, column), row + 1 < height ? ray(row + 1, column) : outside,
                      row > 0 ? ray(row - 1, column) : outside);
    }
    static constexpr Vec3 outside{NAN, NAN, NAN};
    static Vec3 change(Vec3 here, Vec3 next, Vec3 previous) {
        if (!std::isnan(next.z)) return next - here;
        return std::isnan(previous.z) ? Vec3{} : here - previous;
    }
};

struct World {
    const std::vector<Solid>& solids;
    const std::vector<Material>& materials;
    const std::vector<Vec3>& lamps;
};

double light(const World& world, Vec3 point, Vec3 normal) {
    double sum = 0.58 + 0.12 * normal.x + 0.18 * normal.y;
    for (const Vec3& lamp : world.lamps) {
        const Vec3 to_lamp = lamp - point;
        const double squared = dot(to_lamp, to_lamp);
        sum += 0.5 * std::max(0.0, dot(to_lamp, normal)) / (std::sqrt(squared) * (1.0 + squared / 8.0));
    }
    return sum;
}

// Light arriving from the hit surface: its paint (the sharp patches averaged over 2x2 points of the pixel) in the light
// of the lamps.
double radiance(const World& world, Vec3 origin, Vec3 direction, Vec3 right, Vec3 down, const Hit& hit) {
    if (hit.solid < 0) return 0.0;
    const Vec3 point = origin + hit.range * direction;
    const Material& material = world.materials[world.solids[hit.solid].material];
    const double cosine = std::min(-0.05, dot(direction, hit.normal));
    // At a grazing angle the pixel covers a long strip; the geometric mean of its sides keeps some detail across it.
    const float footprint = static_cast<float>(hit.range * norm(right) / std::sqrt(-cosine));
    double patches = 0.0;
    for (int sample = 0; sample < 4; ++sample) {
        const Vec3 bent = direction + ((sample & 1) - 0.5) * 0.5 * right + ((sample >> 1) - 0.5) * 0.5 * down;
        const double range = hit.range * dot(direction, hit.normal) / std::min(-0.02, dot(bent, hit.normal));
        patches += 0.25 * mosaic(material, origin + range * bent, 0.5f * footprint);
    }
    const double albedo = material.albedo + patches + stains(material, point, footprint);
    return std::clamp(albedo, 0.03, 1.0) * light(world, point, hit.normal);
}

bool same_face(const Hit& a, const Hit& b) { return a.solid == b.solid && dot(a.normal, b.normal) > 0.9; }

std::uint64_t splitmix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15ULL;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

// Sum of four uniform numbers, scaled to unit variance: normal enough for grey levels, and the same on every machine.
double noise(std::uint64_t seed, std::uint64_t pixel) {
    const std::uint64_t bits = splitmix(seed ^ splitmix(pixel));
    double sum = 0.0;
    for (int part = 0; part < 4; ++part) sum += static_cast<double>((bits >> (16 * part)) & 0xffffU) / 65536.0 - 0.5;
    return sum * 1.7320508075688772;
}

}  // namespace

void render(const std::vector<Solid>& solids, const std::vector<Material>& materials, const std::vector<Vec3>& lamps,
            const double* rays, int height, int width, const Pose& T_world_camera, const Exposure& exposure,
            int threads, std::uint8_t* image) {
    const World world{solids, materials, lamps};
    const Sensor sensor{rays, height, width};
    const Vec3 origin = T_world_camera.translation();
    std::vector<Hit> hits(static_cast<std::size_t>(height) * width);
    parallel_rows(height, threads, [&](int row) {
        for (int column = 0; column < width; ++column)
            hits[static_cast<std::size_t>(row) * width + column] =
                cast(solids, origin, T_world_camera.rotate(sensor.ray(row, column)));
    });
    auto on_edge = [&](int row, int column) {
        const Hit& hit = hits[static_cast<std::size_t>(row) * width + column];
        for (int r = std::max(0, row - 1); r <= std::min(height - 1, row + 1); ++r)
            for (int c = std::max(0, column - 1); c <= std::min(width - 1, column + 1); ++c)
                if (!same_face(hit, hits[static_cast<std::size_t>(r) * width + c])) return true;
        return false;
    };
    parallel_rows(height, threads, [&](int row) {
        for (int column = 0; column < width; ++column) {
            const std::size_t pixel = static_cast<std::size_t>(row) * width + column;
            const Vec3 ray = sensor.ray(row, column);
            if (std::isnan(ray.z)) {  // outside the field of view
                image[pixel] = 0;
                continue;
            }
            const Vec3 direction = T_world_camera.rotate(ray), right = T_world_camera.rotate(sensor.right(row, column));
            const Vec3 down = T_world_camera.rotate(sensor.down(row, column));
            double value = 0.0;
            if (on_edge(row, column)) {
                constexpr int grid = 3;  // rays across an edge pixel
                for (int sample = 0; sample < grid * grid; ++sample) {
                    const double dx = (sample % grid + 0.5) / grid - 0.5, dy = (sample / grid + 0.5) / grid - 0.5;
                    const Vec3 bent = normalised(direction + dx * right + dy * down);
                    value += radiance(world, origin, bent, (1.0 / grid) * right, (1.0 / grid) * down,
                                      cast(solids, origin, bent));
                }
                value /= grid * grid;
            } else {
                value = radiance(world, origin, direction, right, down, hits[pixel]);
            }
            const double off_axis = std::acos(std::clamp(ray.z, -1.0, 1.0)) / 1.5707963267948966;
            double grey = exposure.gain * value * (1.0 - exposure.vignette * off_axis * off_axis);
            // Shot noise grows with the root of the light; read noise does not.
            grey += exposure.noise * std::sqrt(1.0 + grey / 64.0) * noise(exposure.seed, pixel);
            image[pixel] = static_cast<std::uint8_t>(std::clamp(grey + 0.5, 0.0, 255.0));
        }
    });
}

}  // namespace goshawk
