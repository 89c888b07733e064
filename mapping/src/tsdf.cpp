#include "tsdf.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "parallel.hpp"

namespace goshawk {
namespace {

struct Sample {
    double inverse_range = 0.0;
    int pixel = 0;
};

// Inverse range at a place of the image: bilinear on smooth ground, the nearest value beside a jump or a gap.
Sample sample(const RangeImage& image, double u, double v) {
    const int width = image.lens.width, height = image.lens.height;
    const int column = std::min(static_cast<int>(u), width - 1), row = std::min(static_cast<int>(v), height - 1);
    Sample result;
    result.pixel = row * width + column;
    result.inverse_range = image.inverse_range[result.pixel];
    const double x = u - 0.5, y = v - 0.5;
    const int c = static_cast<int>(std::floor(x)), r = static_cast<int>(std::floor(y));
    if (result.inverse_range <= 0.0 || c < 0 || r < 0 || c + 1 >= width || r + 1 >= height) return result;
    const float* p = image.inverse_range + static_cast<std::size_t>(r) * width + c;
    const float q[4] = {p[0], p[1], p[width], p[width + 1]};
    const auto [low, high] = std::minmax({q[0], q[1], q[2], q[3]});
    if (low <= 0.0f || high > largest_jump * low) return result;
    const double a = x - c, b = y - r;
    result.inverse_range = (1 - b) * ((1 - a) * q[0] + a * q[1]) + b * ((1 - a) * q[2] + a * q[3]);
    return result;
}

struct Rectangle {
    double left, top, right, bottom;
};

// What a cube covers in the image, by its corners; false if one of them is not in the image.
bool covered(const Lens& lens, Vec3 centre, const Vec3 (&half_edges)[3], Rectangle& r) {
    r = {1e9, 1e9, -1e9, -1e9};
    for (int corner = 0; corner < 8; ++corner) {
        Vec3 p = centre;
        for (int axis = 0; axis < 3; ++axis) p = p + ((corner >> axis & 1) ? 1.0 : -1.0) * half_edges[axis];
        double u = 0.0, v = 0.0;
        if (!lens.project(p, u, v)) return false;
        r = {std::min(r.left, u), std::min(r.top, v), std::max(r.right, u), std::max(r.bottom, v)};
    }
    return true;
}

// The largest bound within a square window, whatever its size: the maximum over windows of 1, 2, 4 ... pixels is kept,
// and four of those cover any other (a sparse table).
class LargestInWindow {
  public:
    LargestInWindow(const float* bound, int width, int height) : width_(width), height_(height) {
        levels_.emplace_back(bound, bound + static_cast<std::size_t>(width) * height);
        for (float& value : levels_[0])
            if (value <= 0.0f) value = std::numeric_limits<float>::infinity();  // not known
        for (int size = 1; 2 * size <= std::min({width, height, 64}); size *= 2) {
            std::vector<float> next = levels_.back();
            for (int row = 0; row + 2 * size <= height; ++row)
                for (int column = 0; column + 2 * size <= width; ++column)
                    next[at(row, column)] = four(levels_.back(), row, column, size, size);
            levels_.push_back(std::move(next));
        }
    }

    // In the pixels of a rectangle, at most 128 wide; infinite where one of them is not known, or outside.
    float at(const Rectangle& r) const {
        const int left = static_cast<int>(std::floor(r.left)), top = static_cast<int>(std::floor(r.top));
        const int right = static_cast<int>(std::floor(r.right)), bottom = static_cast<int>(std::floor(r.bottom));
        const int extent = std::max(right - left, bottom - top) + 1;
        if (left < 0 || top < 0 || left + extent > width_ || top + extent > height_)
            return std::numeric_limits<float>::infinity();
        std::size_t level = 0;
        while (level + 1 < levels_.size() && (2 << level) <= extent) ++level;
        const int size = 1 << level;
        if (extent > 2 * size) return std::numeric_limits<float>::infinity();
        return four(levels_[level], top, left, extent - size, extent - size);
    }

  private:
    std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * width_ + column; }
    float four(const std::vector<float>& level, int row, int column, int down, int right) const {
        return std::max({level[at(row, column)], level[at(row + down, column)], level[at(row, column + right)],
                         level[at(row + down, column + right)]});
    }

    int width_, height_;
    std::vector<std::vector<float>> levels_;
};

// The farthest that an image shows, at most `farthest`; 0 where it shows nothing.
double farthest_shown(const float* inverse_range, const Lens& lens, double farthest) {
    float least = std::numeric_limits<float>::infinity();
    for (int i = 0; i < lens.width * lens.height; ++i)
        if (inverse_range[i] > 0.0f) least = std::min(least, inverse_range[i]);
    return std::min(farthest, 1.0 / static_cast<double>(least));
}

// Bricks from `low` to before `high`: all with a voxel within a distance of the camera.
struct Box {
    int low[3], high[3];

    Box(const VoxelGrid& grid, const Pose& T_camera_world, double distance) {
        const Vec3 camera = -1.0 * T_camera_world.rotate_back(T_camera_world.translation());
        const double edge = brick_size * grid.voxel;
        const Vec3 centre = (1.0 / edge) * (camera - grid.origin);
        for (int axis = 0; axis < 3; ++axis) {
            const double most = grid.bricks(axis);
            low[axis] = static_cast<int>(std::clamp(std::floor(centre[axis] - distance / edge), 0.0, most));
            high[axis] = static_cast<int>(std::clamp(std::ceil(centre[axis] + distance / edge), 0.0, most));
        }
    }
};

// Whether no voxel of a brick can be within `reach` of the camera and in its field of view, by the ball about it.
bool out_of_view(const Brick& brick, const VoxelGrid& grid, const Pose& T_camera_world, const Lens& lens,
                 double reach) {
    const double half = 0.5 * brick_size, radius = std::sqrt(3.0) * half * grid.voxel;
    const Vec3 middle{brick.low[0] + half, brick.low[1] + half, brick.low[2] + half};
    const Vec3 centre = T_camera_world.apply(grid.origin + grid.voxel * middle);
    const double range = norm(centre);
    if (range > reach + radius) return true;
    return range > radius && std::acos(centre.z / range) > lens.limit + std::asin(radius / range);
}

// Calls visit(i, j, k, centre in the camera's frame) for each voxel of a brick.
template <typename Visit>
void visit_voxels(const Brick& brick, const VoxelGrid& grid, const Pose& T_camera_world, Visit visit) {
    const double* m = T_camera_world.m;
    const Vec3 step{grid.voxel * m[2], grid.voxel * m[6], grid.voxel * m[10]};
    for (int i = brick.low[0]; i < brick.high[0]; ++i)
        for (int j = brick.low[1]; j < brick.high[1]; ++j) {
            const Vec3 first = grid.origin + grid.voxel * Vec3{i + 0.5, j + 0.5, brick.low[2] + 0.5};
            Vec3 p = T_camera_world.apply(first);
            for (int k = brick.low[2]; k < brick.high[2]; ++k, p = p + step) visit(i, j, k, p);
        }
}

// Weight of a measurement: its inverse variance in metres, never better than a fifth of a voxel.
double weight_of(double range, double deviation, double voxel) {
    const double metres = deviation * range * range, floor = 0.2 * voxel;
    return voxel * voxel / (metres * metres + floor * floor);
}

// The weighted mean and its scatter, updated with one more measurement (West, 1979).
void update(const Volume& volume, std::size_t index, double distance, double weight) {
    const double sum = volume.weight[index] + weight, off = distance - volume.distance[index];
    volume.scatter[index] += static_cast<float>(volume.weight[index] * weight / sum * off * off);
    volume.distance[index] += static_cast<float>(weight / sum * off);
    volume.weight[index] = static_cast<float>(sum);
}

void update_colour(const Volume& volume, std::size_t index, const std::uint8_t* colour, double weight) {
    const double sum = volume.colour_weight[index] + weight;
    for (int c = 0; c < volume.channels; ++c) {
        float& value = volume.colour[index * volume.channels + c];
        value += static_cast<float>(weight / sum * (colour[c] - value));
    }
    volume.colour_weight[index] = static_cast<float>(sum);
}

// From the point in the middle to the one beside it or, if that is missing or on another surface, the one opposite.
bool tangent(const float* inverse_range, const double* rays, int here, int there, int opposite, Vec3& out) {
    auto point = [&](int i) { return (1.0 / inverse_range[i]) * Vec3{rays[3 * i], rays[3 * i + 1], rays[3 * i + 2]}; };
    auto same_surface = [&](int i) {
        const float ratio = i < 0 ? 0.0f : inverse_range[i] / inverse_range[here];
        return ratio > 0.8f && ratio < 1.25f;
    };
    const bool forward = same_surface(there), backward = same_surface(opposite);
    if (!forward && !backward) return false;
    out = point(forward ? there : here) - point(backward ? opposite : here);
    return true;
}

}  // namespace

void facing(const float* inverse_range, const double* rays, int height, int width, int step, float unsure,
            float* cosine) {
    for (int row = 0; row < height; ++row) {
        for (int column = 0; column < width; ++column) {
            const int i = row * width + column;
            cosine[i] = unsure;
            if (inverse_range[i] <= 0.0f) continue;
            Vec3 across, along;
            if (!tangent(inverse_range, rays, i, column + step < width ? i + step : -1, column >= step ? i - step : -1,
                         across) ||
                !tangent(inverse_range, rays, i, row + step < height ? i + step * width : -1,
                         row >= step ? i - step * width : -1, along))
                continue;
            const Vec3 normal = cross(across, along);
            const double length = norm(normal);
            if (length <= 0.0) continue;
            const double value = dot(normal, {rays[3 * i], rays[3 * i + 1], rays[3 * i + 2]}) / length;
            cosine[i] = static_cast<float>(std::clamp(std::abs(value), 0.1, 1.0));
        }
    }
}

void carve(const VoxelGrid& grid, const float* bound, const Lens& lens, const double* T_camera_world, double margin,
           double farthest, int enough, int threads, std::uint8_t* seen_through) {
    const Pose pose(T_camera_world);
    const double half = 0.5 * grid.voxel, reach = farthest_shown(bound, lens, farthest);
    const Vec3 half_edges[3] = {pose.rotate({half, 0, 0}), pose.rotate({0, half, 0}), pose.rotate({0, 0, half})};
    const LargestInWindow nearest(bound, lens.width, lens.height);
    const auto sees_through = [&](Vec3 p) {
        const double range = norm(p);
        double u = 0.0, v = 0.0;
        if (range > farthest || !lens.project(p, u, v)) return false;
        const auto open = [&](float limit) { return (range + margin) * limit < 1.0; };
        Rectangle r;
        // the middle alone first, which costs least
        return open(nearest.at({u, v, u, v})) && covered(lens, p, half_edges, r) && open(nearest.at(r));
    };
    const Box box(grid, pose, reach);
    parallel_rows(box.high[0] - box.low[0], threads, [&](int plane) {
        for (int y = box.low[1]; y < box.high[1]; ++y)
            for (int z = box.low[2]; z < box.high[2]; ++z) {
                const Brick brick(grid, box.low[0] + plane, y, z);
                if (out_of_view(brick, grid, pose, lens, reach)) continue;
                visit_voxels(brick, grid, pose, [&](int i, int j, int k, Vec3 p) {
                    std::uint8_t& count = seen_through[grid.index(i, j, k)];
                    if (count < enough && sees_through(p)) ++count;
                });
            }
    });
}

void integrate(const Volume& volume, const RangeImage& image, const double* T_camera_world, const Fusion& fusion,
               int threads) {
    const Pose pose(T_camera_world);
    const double reach = farthest_shown(image.inverse_range, image.lens, fusion.farthest) + fusion.truncation;
    const auto add = [&](std::size_t index, Vec3 p) {
        const double squared = dot(p, p);
        double u = 0.0, v = 0.0;
        if (squared > reach * reach || !image.lens.project(p, u, v)) return;
        const Sample found = sample(image, u, v);
        if (found.inverse_range * fusion.farthest < 1.0) return;
        const double range = 1.0 / found.inverse_range, along_ray = range - std::sqrt(squared);
        if (along_ray < -fusion.truncation) return;  // hidden behind the surface: nothing is known here
        const double cosine = image.facing[found.pixel], distance = along_ray * cosine;
        double weight = cosine * weight_of(range, image.deviation[found.pixel], volume.grid.voxel);
        // Behind the surface the weight fades, so that the front of a thin board does not erase its back.
        if (distance < 0.0) weight *= 1.0 + 0.9 * along_ray / fusion.truncation;
        update(volume, index, std::min(distance, fusion.truncation), weight);
        if (distance >= fusion.truncation) return;
        update_colour(volume, index, image.colour + static_cast<std::size_t>(found.pixel) * volume.channels, weight);
        if (volume.images[index] < std::numeric_limits<std::uint8_t>::max()) ++volume.images[index];
    };
    parallel_rows(volume.count, threads, [&](int n) {
        const Brick brick = volume.brick(n);
        if (out_of_view(brick, volume.grid, pose, image.lens, reach)) return;
        visit_voxels(brick, volume.grid, pose,
                     [&](int i, int j, int k, Vec3 p) { add(n * brick_voxels + within_brick(i, j, k), p); });
    });
}

}  // namespace goshawk
