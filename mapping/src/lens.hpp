// From a direction to a pixel: all lens models of mapping/lens.py. Pixel centres lie at .5.
#pragma once
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
          radial(p[0] == 0.0 && p[1] == 0.0 && s[0] == 0.0 && s[1] == 0.0 && s[2] == 0.0 && s[3] == 0.0) {}

    // False where the lens does not show the direction at all, or beside the image.
    bool project(Vec3 q, double& u, double& v) const {
        const double squared = q.x * q.x + q.y * q.y, rho = std::sqrt(squared);
        // most of a volume is out of view: refused before the angle is computed, which costs most
        if (q.z < cosine_of_limit * std::sqrt(squared + q.z * q.z) || (rho <= 1e-12 && q.z <= 0.0)) return false;
        const double theta = std::atan2(rho, q.z);
        const double stretch = rho > 1e-12 ? base_radius(q, rho, theta) / rho : 0.0;
        const double x = stretch * q.x, y = stretch * q.y;
        const double square = x * x + y * y;
        double polynomial = 0.0;
        for (int i = terms - 1; i >= 0; --i) polynomial = square * (k[i] + polynomial);
        double across = x * (1.0 + polynomial), down = y * (1.0 + polynomial);
        if (!radial) {
            const double a = in_turn ? across : x, b = in_turn ? down : y;
            const double r2 = a * a + b * b;
            across += 2.0 * p[0] * a * b + p[1] * (r2 + 2.0 * a * a) + r2 * (s[0] + r2 * s[1]);
            down += 2.0 * p[1] * a * b + p[0] * (r2 + 2.0 * b * b) + r2 * (s[2] + r2 * s[3]);
        }
        u = fx * across + cx;
        v = fy * down + cy;
        return u >= 0.0 && v >= 0.0 && u < width && v < height;
    }

  private:
    double base_radius(Vec3 q, double rho, double theta) const {
        if (base == LensBase::angle) return theta;
        if (base == LensBase::perspective) return rho / q.z;  // below the limit of 89 degrees z is positive
        return rho / (alpha * std::sqrt(beta * rho * rho + q.z * q.z) + (1.0 - alpha) * q.z);
    }
};

}  // namespace goshawk
