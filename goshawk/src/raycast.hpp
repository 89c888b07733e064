// Where a ray first meets a scene of analytic solids, in closed form.
#pragma once
#include <limits>
#include <vector>

#include "vec3.hpp"

namespace goshawk {

enum class Kind { box = 0, sphere = 1, cylinder = 2, room = 3 };

// Box and room: half extents. Sphere: half.x is the radius. Cylinder, axis along world z: radius half.x, half height
// half.z.
struct Solid {
    Kind kind;
    Vec3 centre;
    Vec3 half;
    int material;
};

struct Hit {
    double range = std::numeric_limits<double>::infinity();
    int solid = -1;
    Vec3 normal;  // out of the matter, towards free space
};

constexpr double nearest_range = 1e-6;  // a ray that starts on a surface does not hit it

inline Vec3 axis_normal(int axis, double sign) {
    return {axis == 0 ? sign : 0.0, axis == 1 ? sign : 0.0, axis == 2 ? sign : 0.0};
}

// Slab test. A box is met where the ray enters the last slab, a room (a box seen from inside) where it leaves the
// first.
inline bool hit_slabs(const Solid& solid, Vec3 origin, Vec3 direction, Hit& hit) {
    double enter = -std::numeric_limits<double>::infinity(), leave = -enter;
    int enter_axis = 0, leave_axis = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double o = origin[axis] - solid.centre[axis], d = direction[axis], h = solid.half[axis];
        if (d == 0.0) {
            if (std::abs(o) > h) return false;
            continue;
        }
        const double near = (-std::copysign(h, d) - o) / d, far = (std::copysign(h, d) - o) / d;
        if (near > enter) enter = near, enter_axis = axis;
        if (far < leave) leave = far, leave_axis = axis;
    }
    if (enter > leave) return false;
    const bool inside_out = solid.kind == Kind::room;
    const double range = inside_out ? leave : enter;
    const int axis = inside_out ? leave_axis : enter_axis;
    if (range <= nearest_range || range >= hit.range) return false;
    hit.range = range;
    hit.normal = axis_normal(axis, direction[axis] > 0.0 ? -1.0 : 1.0);
    return true;
}

inline bool hit_sphere(const Solid& solid, Vec3 origin, Vec3 direction, Hit& hit) {
    const Vec3 o = origin - solid.centre;
    const double b = dot(o, direction), c = dot(o, o) - solid.half.x * solid.half.x, discriminant = b * b - c;
    if (discriminant < 0.0) return false;
    const double range = -b - std::sqrt(discriminant);
    if (range <= nearest_range || range >= hit.range) return false;
    hit.range = range;
    hit.normal = (1.0 / solid.half.x) * (o + range * direction);
    return true;
}

inline bool hit_cylinder(const Solid& solid, Vec3 origin, Vec3 direction, Hit& hit) {
    const Vec3 o = origin - solid.centre;
    const double radius = solid.half.x, half_height = solid.half.z;
    const double a = direction.x * direction.x + direction.y * direction.y;
    const double b = o.x * direction.x + o.y * direction.y, c = o.x * o.x + o.y * o.y - radius * radius;
    const double discriminant = b * b - a * c;
    if (a > 0.0 && discriminant >= 0.0) {
        const double range = (-b - std::sqrt(discriminant)) / a, z = o.z + range * direction.z;
        if (range > nearest_range && range < hit.range && std::abs(z) <= half_height) {
            hit.range = range;
            hit.normal = {(o.x + range * direction.x) / radius, (o.y + range * direction.y) / radius, 0.0};
            return true;
        }
    }
    if (direction.z == 0.0) return false;
    const double side = direction.z > 0.0 ? -1.0 : 1.0, range = (side * half_height - o.z) / direction.z;
    if (range <= nearest_range || range >= hit.range) return false;
    const double x = o.x + range * direction.x, y = o.y + range * direction.y;
    if (x * x + y * y > radius * radius) return false;
    hit.range = range;
    hit.normal = {0.0, 0.0, side};
    return true;
}

inline Hit cast(const std::vector<Solid>& solids, Vec3 origin, Vec3 direction) {
    Hit hit;
    for (int i = 0; i < static_cast<int>(solids.size()); ++i) {
        const Solid& solid = solids[i];
        bool nearer = false;
        switch (solid.kind) {
            case Kind::sphere:
                nearer = hit_sphere(solid, origin, direction, hit);
                break;
            case Kind::cylinder:
                nearer = hit_cylinder(solid, origin, direction, hit);
                break;
            default:
                nearer = hit_slabs(solid, origin, direction, hit);
        }
        if (nearer) hit.solid = i;
    }
    return hit;
}

}  // namespace goshawk
