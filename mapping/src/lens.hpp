// From a direction to a pixel: Kannala-Brandt fisheye or pinhole. Pixel centres lie at .5.
#pragma once
#include "vec3.hpp"

namespace goshawk {

struct Lens {
    bool fisheye;
    double fx, fy, cx, cy;
    double k[4];
    double limit;  // largest angle from the axis that the lens shows, radians
    int width, height;

    // Row: fisheye, fx, fy, cx, cy, k1, k2, k3, k4, limit, width, height.
    explicit Lens(const double* row)
        : fisheye(row[0] != 0.0),
          fx(row[1]),
          fy(row[2]),
          cx(row[3]),
          cy(row[4]),
          k{row[5], row[6], row[7], row[8]},
          limit(row[9]),
          width(static_cast<int>(row[10])),
          height(static_cast<int>(row[11])) {}

    // False where the lens does not show the direction at all, or beside the image.
    bool project(Vec3 p, double& u, double& v) const {
        const double rho = std::sqrt(p.x * p.x + p.y * p.y);
        double stretch = 0.0;
        if (fisheye) {
            const double theta = std::atan2(rho, p.z);
            if (theta > limit) return false;
            const double s = theta * theta;
            const double radius = theta * (1.0 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
            stretch = rho > 1e-12 ? radius / rho : 0.0;
        } else {
            if (p.z <= 0.0) return false;
            stretch = 1.0 / p.z;
        }
        u = fx * stretch * p.x + cx;
        v = fy * stretch * p.y + cy;
        return u >= 0.0 && v >= 0.0 && u < width && v < height;
    }
};

}  // namespace goshawk
