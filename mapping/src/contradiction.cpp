#include "contradiction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "parallel.hpp"

namespace goshawk {
namespace {

constexpr double same_surface_m = 0.06, same_surface = 0.04;  // how much farther a point may be than what is in view

Vec3 ray_of(const double* rays, int i) { return {rays[3 * i], rays[3 * i + 1], rays[3 * i + 2]}; }

// Range to a plane if the ray meets it in the voxel that it leaves at `end`, or less than half of one beside; else 0.
double meets(const double* plane, Vec3 origin, Vec3 ray, double start, double end, double slack) {
    const Vec3 point{plane[0], plane[1], plane[2]}, normal{plane[3], plane[4], plane[5]};
    const double along = dot(normal, ray);
    if (std::abs(along) < 1e-3) return 0.0;
    const double range = dot(normal, point - origin) / along;
    return range > start - slack && range < end + slack ? range : 0.0;
}

// The way of a ray from cell to cell of a cubic grid (Amanatides and Woo, 1987).
struct Walk {
    int cell[3], step[3];
    double next[3], each[3];
    double entered = 0.0;  // the cell

    // `start` in cells, `ray` in cells a unit of length.
    Walk(Vec3 start, Vec3 ray) {
        for (int axis = 0; axis < 3; ++axis) {
            cell[axis] = static_cast<int>(std::floor(start[axis]));
            step[axis] = ray[axis] < 0.0 ? -1 : 1;
            const double speed = std::abs(ray[axis]);
            each[axis] = speed > 1e-12 ? 1.0 / speed : std::numeric_limits<double>::infinity();
            const double left = step[axis] > 0 ? cell[axis] + 1.0 - start[axis] : start[axis] - cell[axis];
            next[axis] = speed > 1e-12 ? left * each[axis] : std::numeric_limits<double>::infinity();
        }
    }
    bool inside(const int (&shape)[3]) const {
        return cell[0] >= 0 && cell[1] >= 0 && cell[2] >= 0 && cell[0] < shape[0] && cell[1] < shape[1] &&
               cell[2] < shape[2];
    }
    double leaves() const { return std::min({next[0], next[1], next[2]}); }
    void go_on() {
        const int axis = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
        entered = next[axis];
        next[axis] += each[axis];
        cell[axis] += step[axis];
    }
};

// Range to the first plane between two ranges; 0 where nothing is met, below 0 where something blocks the ray.
double within(const Planes& planes, Vec3 origin, Vec3 ray, double from, double to) {
    const VoxelGrid& grid = planes.grid;
    const double scale = 1.0 / grid.voxel;
    const double begin = std::max(from - 1e-6, 0.0);
    const Vec3 in_voxels = scale * (origin + begin * ray - grid.origin);
    for (Walk walk(in_voxels, scale * ray); begin + walk.entered < to; walk.go_on()) {
        if (!walk.inside(grid.shape)) continue;  // just before or behind the brick
        const std::int32_t number = planes.number[grid.index(walk.cell[0], walk.cell[1], walk.cell[2])];
        if (number == Planes::blocked) return -1.0;
        if (number < 0) continue;
        const double range = meets(planes.plane + 6 * static_cast<std::size_t>(number), origin, ray,
                                   begin + walk.entered, begin + walk.leaves(), 0.5 * grid.voxel);
        if (range > 0.0) return range;
    }
    return 0.0;
}

float first_range(const Planes& planes, Vec3 origin, Vec3 ray, double farthest) {
    const VoxelGrid& grid = planes.grid;
    const double scale = 1.0 / (brick_size * grid.voxel);
    const int bricks[3] = {grid.bricks(0), grid.bricks(1), grid.bricks(2)};
    Walk walk(scale * (origin - grid.origin), scale * ray);
    for (; walk.entered < farthest && walk.inside(bricks); walk.go_on()) {
        if (!planes.filled[grid.brick_index(walk.cell[0], walk.cell[1], walk.cell[2])]) continue;
        const double range = within(planes, origin, ray, walk.entered, walk.leaves());
        if (range != 0.0) return static_cast<float>(std::max(range, 0.0));
    }
    return 0.0f;
}

// Where another image shows a point of the surface; false if it does not, or shows something nearer.
bool seen(const ShownSurface& view, Vec3 point, double& u, double& v) {
    if (!view.lens.project(point, u, v)) return false;
    const double range = view.range_at(u, v);
    return range > 0.0 && range > norm(point) * (1.0 - same_surface) - same_surface_m;
}

// Bilinear between the middles of four pixels; 0 at the border.
float between(const std::uint8_t* grey, int width, int height, double u, double v) {
    const double x = u - 0.5, y = v - 0.5;
    const int c = static_cast<int>(std::floor(x)), r = static_cast<int>(std::floor(y));
    if (c < 0 || r < 0 || c + 1 >= width || r + 1 >= height) return 0.0f;
    const double a = x - c, b = y - r;
    const std::uint8_t* p = grey + static_cast<std::size_t>(r) * width + c;
    return static_cast<float>((1 - b) * ((1 - a) * p[0] + a * p[1]) + b * ((1 - a) * p[width] + a * p[width + 1]));
}

// Number of pixels of one kind in any rectangle.
class Sums {
  public:
    template <typename Counts>
    Sums(const std::uint8_t* verdict, int width, int height, Counts counts)
        : width_(width), sum_(static_cast<std::size_t>(width + 1) * (height + 1), 0) {
        for (int row = 0; row < height; ++row)
            for (int column = 0, line = 0; column < width; ++column) {
                line += counts(verdict[static_cast<std::size_t>(row) * width + column]) ? 1 : 0;
                sum_[at(row + 1, column + 1)] = sum_[at(row, column + 1)] + line;
            }
    }
    int in(int left, int top, int right, int bottom) const {
        return sum_[at(bottom, right)] - sum_[at(top, right)] - sum_[at(bottom, left)] + sum_[at(top, left)];
    }

  private:
    std::size_t at(int row, int column) const { return static_cast<std::size_t>(row) * (width_ + 1) + column; }
    int width_;
    std::vector<int> sum_;
};

}  // namespace

void surface_ranges(const Planes& planes, const double* rays, int count, const double* T_world_camera, double farthest,
                    float* range) {
    const Pose pose(T_world_camera);
    for (int i = 0; i < count; ++i) {
        const Vec3 ray = pose.rotate(ray_of(rays, i));
        range[i] = std::isfinite(ray.x) ? first_range(planes, pose.translation(), ray, farthest) : 0.0f;
    }
}

void match_through_surface(const ShownSurface& image, const double* rays, const ShownSurface& partner,
                           const double* T_partner_camera, int step, float* matched) {
    const Pose pose(T_partner_camera);
    const int width = image.lens.width, height = image.lens.height, columns = width / step, rows = height / step;
    for (int r = 0; r < rows; ++r)
        for (int c = 0; c < columns; ++c) {
            const int row = r * step + step / 2, column = c * step + step / 2, i = row * width + column;
            const double range = image.range_at(column, row);
            double u = 0.0, v = 0.0;
            matched[r * columns + c] = 0.0f;
            if (range > 0.0 && image.grey[i] > 0 && seen(partner, pose.apply(range * ray_of(rays, i)), u, v))
                matched[r * columns + c] = between(partner.grey, partner.lens.width, partner.lens.height, u, v);
        }
}

void compare_through_surface(const ShownSurface& image, const double* rays, const ShownSurface& partner,
                             const double* T_partner_camera, const Comparison& comparison, std::uint8_t* counts) {
    const Pose pose(T_partner_camera);
    const int width = image.lens.width, height = image.lens.height, step = comparison.step;
    const int columns = width / step, rows = height / step;
    for (int row = 0; row < height; ++row)
        for (int column = row & 1; column < width; column += 2) {
            const int i = row * width + column;
            std::uint8_t* count = counts + 3 * static_cast<std::size_t>(i);
            const double range = image.range_at(column, row);
            double u = 0.0, v = 0.0;
            if (!(range > 0.0) || image.grey[i] == 0 || count[0] >= comparison.enough) continue;
            if (!seen(partner, pose.apply(range * ray_of(rays, i)), u, v)) continue;
            const std::size_t there = static_cast<std::size_t>(v) * partner.lens.width + static_cast<std::size_t>(u);
            if (comparison.least[there] == 0) continue;  // beside what the lens shows, or masked
            const int part = std::min(row / step, rows - 1) * columns + std::min(column / step, columns - 1);
            const double expected = comparison.gain[part] * image.grey[i];
            const bool lighter = expected > comparison.most[there] + comparison.allowed;
            const bool darker = expected < comparison.least[there] - comparison.allowed;
            ++count[lighter ? 1 : darker ? 2 : 0];
        }
}

void count_looks(const VoxelGrid& grid, const std::uint8_t* marked, const std::uint8_t* verdict,
                 const ShownSurface& image, const double* T_camera_world, const LookOptions& options, int threads,
                 std::uint8_t* looks, std::uint8_t* contradictions) {
    const Pose pose(T_camera_world);
    const int width = image.lens.width, height = image.lens.height;
    const Sums tested(verdict, width, height, [](std::uint8_t v) { return v > 0; });
    const Sums differing(verdict, width, height, [](std::uint8_t v) { return v == 2; });
    const Vec3 camera = -1.0 * pose.rotate_back(pose.translation());
    const double half = 0.625 * grid.voxel;  // a quarter more than half an edge, as a cube is seen cornerwise
    constexpr auto most = std::numeric_limits<std::uint8_t>::max();
    const auto add = [&](std::size_t index, Vec3 q) {
        const double squared = dot(q, q);
        double u = 0.0, v = 0.0, beside_u = 0.0, beside_v = 0.0;
        if (squared < options.nearest * options.nearest || squared > options.farthest * options.farthest) return;
        if (!image.lens.project(q, u, v) || image.range_at(u, v) < std::sqrt(squared) + options.margin) return;
        const Vec3 aside = normalised(cross(q, std::abs(q.x) < std::abs(q.y) ? Vec3{1, 0, 0} : Vec3{0, 1, 0}));
        if (!image.lens.project(q + half * aside, beside_u, beside_v)) return;
        const double reach = std::hypot(beside_u - u, beside_v - v);
        const int left = static_cast<int>(std::floor(u - reach)), top = static_cast<int>(std::floor(v - reach));
        const int right = static_cast<int>(std::floor(u + reach)) + 1,
                  bottom = static_cast<int>(std::floor(v + reach)) + 1;
        if (left < 0 || top < 0 || right > width || bottom > height) return;
        const int pixels = (right - left) * (bottom - top), across = std::min(right - left, bottom - top);
        const int asked = tested.in(left, top, right, bottom);
        if (asked < options.least_tested * pixels || looks[index] == most) return;
        ++looks[index];
        const double wanted =
            std::max({1.0 * options.least_pixels, options.least_share * across, options.least_rate * asked});
        if (differing.in(left, top, right, bottom) >= wanted) ++contradictions[index];
    };
    const Vec3 up = pose.rotate({0.0, 0.0, grid.voxel});
    int low[3], high[3];
    for (int axis = 0; axis < 3; ++axis) {
        const double at = (camera[axis] - grid.origin[axis]) / grid.voxel, around = options.farthest / grid.voxel + 1.0;
        low[axis] = static_cast<int>(std::clamp(at - around, 0.0, static_cast<double>(grid.shape[axis])));
        high[axis] = static_cast<int>(std::clamp(at + around, 0.0, static_cast<double>(grid.shape[axis])));
    }
    parallel_rows(high[0] - low[0], threads, [&](int n) {
        const int i = low[0] + n;
        for (int j = low[1]; j < high[1]; ++j) {
            const Vec3 first = grid.origin + grid.voxel * Vec3{i + 0.5, j + 0.5, low[2] + 0.5};
            Vec3 q = pose.apply(first);
            for (int k = low[2]; k < high[2]; ++k, q = q + up)
                if (marked[grid.index(i, j, k)]) add(grid.index(i, j, k), q);
        }
    });
}

}  // namespace goshawk
