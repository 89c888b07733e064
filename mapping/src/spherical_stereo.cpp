#include "spherical_stereo.hpp"

#include <algorithm>
#include <cmath>

namespace goshawk {
namespace {

Vec3 rotate(const double* R, Vec3 v) {
    return {R[0] * v.x + R[1] * v.y + R[2] * v.z, R[3] * v.x + R[4] * v.y + R[5] * v.z,
            R[6] * v.x + R[7] * v.y + R[8] * v.z};
}

Vec3 rotate_back(const double* R, Vec3 v) {
    return {R[0] * v.x + R[3] * v.y + R[6] * v.z, R[1] * v.x + R[4] * v.y + R[7] * v.z,
            R[2] * v.x + R[5] * v.y + R[8] * v.z};
}

std::uint8_t bilinear(const std::uint8_t* image, int width, int height, double u, double v) {
    const double x = std::clamp(u - 0.5, 0.0, width - 1.001), y = std::clamp(v - 0.5, 0.0, height - 1.001);
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const double a = x - i, b = y - j;
    const std::uint8_t* p = image + static_cast<std::size_t>(j) * width + i;
    const double top = p[0] + a * (p[1] - p[0]), bottom = p[width] + a * (p[width + 1] - p[width]);
    return static_cast<std::uint8_t>(top + b * (bottom - top) + 0.5);
}

// Disparity at a fractional place, in columns: bilinear on smooth ground, the nearest value beside a jump or a gap.
double disparity_at(const std::int16_t* disparity, const SphericalGrid& grid, double column, double row) {
    const int c = static_cast<int>(std::floor(column)), r = static_cast<int>(std::floor(row));
    if (c < 0 || r < 0 || c + 1 >= grid.columns || r + 1 >= grid.rows) return 0.0;
    const std::int16_t* p = disparity + static_cast<std::size_t>(r) * grid.columns + c;
    const int d[4] = {p[0], p[1], p[grid.columns], p[grid.columns + 1]};
    const double a = column - c, b = row - r;
    const auto [low, high] = std::minmax({d[0], d[1], d[2], d[3]});
    if (low > 0 && high - low < 24)
        return ((1 - b) * ((1 - a) * d[0] + a * d[1]) + b * ((1 - a) * d[2] + a * d[3])) / 16.0;
    return d[(a > 0.5) + 2 * (b > 0.5)] / 16.0;
}

constexpr double largest_angle = M_PI - 0.02;  // from the baseline, at the partner

// A unit direction from the camera: its angle from the baseline with sine and cosine, and its place in the rectified
// image.
struct GridRay {
    double angle, sine, cosine, column, row;

    GridRay(const SphericalGrid& grid, const double* R_camera_grid, Vec3 ray) {
        const Vec3 g = rotate_back(R_camera_grid, ray);
        sine = std::sqrt(g.y * g.y + g.z * g.z);
        cosine = g.x;
        angle = std::atan2(sine, cosine);
        column = (grid.from_baseline - angle) / grid.column_step;
        row = (std::atan2(g.z, g.y) - grid.from_axis) / grid.row_step;
    }

    // Law of sines in the triangle camera - partner - point: range / sin(angle + parallax) = baseline / sin(parallax).
    double range_over_baseline(double cotangent_of_parallax) const { return sine * cotangent_of_parallax + cosine; }
};

// The bound along a ray; 0 where it is not known.
double largest_inverse_range(const std::int16_t* nearest, const SphericalGrid& grid, const StereoPair& pair,
                             const GridRay& ray) {
    const int c = static_cast<int>(ray.column), r = static_cast<int>(ray.row);
    if (c < 0 || r < 0 || c >= grid.columns || r >= grid.rows) return 0.0;
    const int d = nearest[static_cast<std::size_t>(r) * grid.columns + c];
    const double parallax = (d / 16.0 + pair.deviations * pair.disparity_std_px) * grid.column_step;
    if (d < 0 || ray.angle + parallax >= largest_angle) return 0.0;
    return 1.0 / (pair.baseline_m * ray.range_over_baseline(1.0 / std::tan(parallax)));
}

}  // namespace

void rectify(const std::uint8_t* image, const Lens& lens, const double* R_camera_grid, const SphericalGrid& grid,
             std::uint8_t* out) {
    std::vector<double> cosine(grid.columns), sine(grid.columns);
    for (int c = 0; c < grid.columns; ++c) {
        const double angle = grid.from_baseline - (c + 0.5) * grid.column_step;
        cosine[c] = std::cos(angle);
        sine[c] = angle > 0.0 && angle < M_PI ? std::sin(angle) : -1.0;  // -1: no such direction
    }
    for (int r = 0; r < grid.rows; ++r) {
        const double angle = grid.from_axis + (r + 0.5) * grid.row_step, a = std::cos(angle), b = std::sin(angle);
        std::uint8_t* row = out + static_cast<std::size_t>(r) * grid.columns;
        for (int c = 0; c < grid.columns; ++c) {
            double u = 0.0, v = 0.0;
            const bool seen =
                sine[c] >= 0.0 && lens.project(rotate(R_camera_grid, {cosine[c], sine[c] * a, sine[c] * b}), u, v);
            row[c] = seen ? bilinear(image, lens.width, lens.height, u, v) : 0;
        }
    }
}

void inverse_range(const std::int16_t* disparity, const std::int16_t* nearest, const SphericalGrid& grid,
                   const double* R_camera_grid, const StereoPair& pair, const Lens& partner, const double* rays,
                   int count, float* inverse_range, float* standard_deviation, float* bound) {
    const Pose T_partner_camera(pair.T_partner_camera);
    for (int i = 0; i < count; ++i) {
        inverse_range[i] = standard_deviation[i] = bound[i] = 0.0f;
        const Vec3 ray{rays[3 * i], rays[3 * i + 1], rays[3 * i + 2]};
        if (std::isnan(ray.z)) continue;
        const GridRay along(grid, R_camera_grid, ray);
        bound[i] = static_cast<float>(largest_inverse_range(nearest, grid, pair, along));
        const double d = disparity_at(disparity, grid, along.column - 0.5, along.row - 0.5);
        const double parallax = d * grid.column_step;
        if (d <= 0.0 || along.angle + parallax >= largest_angle) continue;
        const double cotangent = 1.0 / std::tan(parallax);
        const double value = 1.0 / (pair.baseline_m * along.range_over_baseline(cotangent));
        const double slope = pair.baseline_m * along.sine * (1.0 + cotangent * cotangent) * value * value;
        const double deviation = slope * pair.disparity_std_px * grid.column_step;
        double u = 0.0, v = 0.0;
        if (deviation > pair.largest_relative_std * value) continue;
        if (!partner.project(T_partner_camera.apply((1.0 / value) * ray), u, v)) continue;
        inverse_range[i] = static_cast<float>(value);
        standard_deviation[i] = static_cast<float>(deviation);
    }
}

void fuse(const float* values, const float* deviations, int layers, int count, double tolerance, int least,
          float* value, float* deviation) {
    for (int i = 0; i < count; ++i) {
        double best_sum = 0.0, best_weight = 0.0;
        int best = 0;
        for (int a = 0; a < layers; ++a) {
            const double centre = values[a * static_cast<std::size_t>(count) + i];
            if (centre <= 0.0) continue;
            const double own = deviations[a * static_cast<std::size_t>(count) + i];
            double sum = 0.0, weight = 0.0;
            int agreeing = 0;
            for (int b = 0; b < layers; ++b) {
                const double other = values[b * static_cast<std::size_t>(count) + i];
                const double theirs = deviations[b * static_cast<std::size_t>(count) + i];
                const double apart = other - centre, allowed = tolerance * tolerance * (own * own + theirs * theirs);
                if (other <= 0.0 || apart * apart > allowed) continue;
                ++agreeing;
                sum += other / (theirs * theirs);
                weight += 1.0 / (theirs * theirs);
            }
            if (agreeing > best || (agreeing == best && weight > best_weight))
                best = agreeing, best_sum = sum, best_weight = weight;
        }
        const bool enough = best >= least;
        value[i] = enough ? static_cast<float>(best_sum / best_weight) : 0.0f;
        deviation[i] = enough ? static_cast<float>(1.0 / std::sqrt(best_weight)) : 0.0f;
    }
}

}  // namespace goshawk
