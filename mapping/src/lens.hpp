// From a direction to a pixel: all lens models of mapping/lens.py. Pixel centres lie at .5.
#pragma once
#include <vector>

#include "vec3.hpp"

namespace goshawk {

enum class LensBase { perspective = 0, angle = 1, eucm = 2 };

struct Lens {
    static constexpr int row_size = 23;
    static constexpr int terms = 6;

    double fx, fy, cx, cy;
    LensBase base;
    double k[terms];
    double p[2];
    double s[4];
    double alpha, beta;
    bool in_turn;  // tangential terms and prism act on the radially distorted place
    double limit;  // largest angle from the axis that the lens shows, radians
    double cosine_of_limit;
    int width, height;
    bool radial;  // neither tangential terms nor prism

    // Row: fx, fy, cx, cy, base, k1..k6, p1, p2, s1..s4, alpha, beta, in_turn, limit, width, height.
    explicit Lens(const double* row)
        : fx(row[0]),
          fy(row[1]),
          cx(row[2]),
          cy(row[3]),
          base(static_cast<LensBase>(static_cast<int>(row[4]))),
          k{row[5], row[6], row[7], row[8], row[9], row[10]},
          p{row[11], row[12]},
          s{row[13], row[14], row[15], row[16]},
          alpha(row[17]),
          beta(row[18]),
          in_turn(row[19] != 0.0),
          limit(row[20]),
          cosine_of_limit(std::cos(limit)),
          width(static_cast<int>(row[21])),
          height(static_cast<int>(row[22])),
          radial(p[0] == 0.0 && p[1] == 0.0 && s[0] == 0.0 && s[1] == 0.0 && s[2] == 0.0 && s[3] == 0.0) {
        if (base == LensBase::angle && radial) tabulate();
    }

    // False where the lens does not show the direction at all, or beside the image.
    bool project(Vec3 q, double& u, double& v) const {
        const double squared = q.x * q.x + q.y * q.y, range = std::sqrt(squared + q.z * q.z);
        // most of a volume is out of view: refused before the angle is computed, which costs most
        if (q.z < cosine_of_limit * range || (squared <= 1e-24 && q.z <= 0.0)) return false;
        if (!stretch_.empty() && q.z > least_cosine * range) {
            const double stretch = tabulated(q.z / range) / range;
            u = fx * stretch * q.x + cx;
            v = fy * stretch * q.y + cy;
        } else {
            distort(q, std::sqrt(squared), u, v);
        }
        return u >= 0.0 && v >= 0.0 && u < width && v < height;
    }

  private:
    // A fisheye without tangential terms moves along the radius alone, and the radius on the sensor over the sine of
    // the angle from the axis is a smooth function of that angle's cosine. Linear between `table_size` places it is off
    // by less than 1e-6 of itself, which is less than a thousandth of a pixel, and needs no arc tangent.
    static constexpr int table_size = 2048;
    static constexpr double least_cosine = -0.6;  // towards -1 it is not smooth
    static constexpr double per_cosine = table_size / (1.0 - least_cosine);
    std::vector<double> stretch_;

    void tabulate() {
        stretch_.resize(table_size + 2);  // rounding may put the cosine of the axis beyond 1
        for (int i = 0; i < table_size + 2; ++i) {
            const double cosine = std::fmin(least_cosine + i / per_cosine, 1.0), theta = std::acos(cosine);
            const double sine = std::sqrt(1.0 - cosine * cosine);
            stretch_[i] = (sine > 0.0 ? theta / sine : 1.0) * (1.0 + polynomial(theta * theta));
        }
    }

    double tabulated(double cosine) const {
        const double place = (cosine - least_cosine) * per_cosine;
        const int i = static_cast<int>(place);
        return stretch_[i] + (place - i) * (stretch_[i + 1] - stretch_[i]);
    }

    // k1 r^2 + k2 r^4 + ...
    double polynomial(double square) const {
        double sum = 0.0;
        for (int i = terms - 1; i >= 0; --i) sum = square * (k[i] + sum);
        return sum;
    }

    void distort(Vec3 q, double rho, double& u, double& v) const {
        const double stretch = rho > 1e-12 ? base_radius(q, rho) / rho : 0.0;
        const double x = stretch * q.x, y = stretch * q.y;
        const double radially = 1.0 + polynomial(x * x + y * y);
        double across = radially * x, down = radially * y;
        if (!radial) {
            const double a = in_turn ? across : x, b = in_turn ? down : y;
            const double r2 = a * a + b * b;
            across += 2.0 * p[0] * a * b + p[1] * (r2 + 2.0 * a * a) + r2 * (s[0] + r2 * s[1]);
            down += 2.0 * p[1] * a * b + p[0] * (r2 + 2.0 * b * b) + r2 * (s[2] + r2 * s[3]);
        }
        u = fx * across + cx;
        v = fy * down + cy;
    }

    double base_radius(Vec3 q, double rho) const {
        if (base == LensBase::angle) return std::atan2(rho, q.z);
        if (base == LensBase::perspective) return rho / q.z;  // below the limit of 89 degrees z is positive
        return rho / (alpha * std::sqrt(beta * rho * rho + q.z * q.z) + (1.0 - alpha) * q.z);
    }
};

}  // namespace goshawk
