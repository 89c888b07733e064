#include "lines.hpp"

#include <algorithm>
#include <bitset>
#include <cstddef>
#include <vector>

#include "parallel.hpp"

namespace goshawk {
namespace {

Vec3 row(const double* table, int i) { return {table[3 * i], table[3 * i + 1], table[3 * i + 2]}; }

// One segment with the plane through it and its camera.
struct Arc {
    Vec3 first, last, normal;
    double extent;  // angle from the first end to the last

    Arc(const Segments& segments, int i) : first(row(segments.first, i)), last(row(segments.last, i)) {
        const Vec3 n = cross(first, last);
        extent = std::atan2(norm(n), dot(first, last));
        normal = normalised(n);
    }
    // Angle from the first end to a direction, in the plane.
    double angle_of(Vec3 direction) const {
        return std::atan2(dot(direction, cross(normal, first)), dot(direction, first));
    }
};

struct Proposal {
    int partner;
    double inverse_range[2], std[2];  // of the first and the last end
};

// The inverse range at which a ray meets the partner's plane, unless that is too near. What is far away competes too,
// else a near line would be made of it; by its noise it may seem to be beyond infinity.
bool meets(const Arc& other, Vec3 ray, double along_offset, const LineSearch& search, double& inverse_range) {
    inverse_range = dot(other.normal, ray) / along_offset;
    return inverse_range * search.farthest_m > -1.0 && inverse_range * search.nearest_m < 1.0;
}

// The ranges at which a segment of the partner shows the same line, if it can.
bool propose(const Arc& mine, const Arc& other, Vec3 offset, const LineSearch& search, Proposal& found) {
    const double along_offset = dot(other.normal, offset);
    if (!meets(other, mine.first, along_offset, search, found.inverse_range[0]) ||
        !meets(other, mine.last, along_offset, search, found.inverse_range[1]))
        return false;
    double angle[2];
    for (int end = 0; end < 2; ++end) {
        const double inverse_range = found.inverse_range[end];
        const Vec3 from_partner = (end ? mine.last : mine.first) - inverse_range * offset;  // times the inverse range
        angle[end] = other.angle_of(from_partner);
        // The place on a line through two ends with errors of their own; beyond them the error grows.
        const double share = angle[end] / other.extent, across = std::hypot(share, 1.0 - share);
        const double std_rad = search.std_rad * std::hypot(across * norm(from_partner), 1.0);
        found.std[end] = std_rad / std::abs(along_offset);
        if (found.std[end] > search.largest_relative_std * std::max(inverse_range, 1.0 / search.farthest_m))
            return false;
    }
    const double length = angle[1] - angle[0];  // negative: light and dark are exchanged
    const double common = std::min(angle[1], other.extent) - std::max(angle[0], 0.0);
    return length > 0.0 && common > search.least_overlap * std::min(length, other.extent);
}

bool agree(const Proposal& a, const Proposal& b, double tolerance) {
    for (int end = 0; end < 2; ++end)
        if (std::abs(a.inverse_range[end] - b.inverse_range[end]) > tolerance * std::hypot(a.std[end], b.std[end]))
            return false;
    return true;
}

}  // namespace

void sweep_lines(const Segments& segments, const Partners& partners, const LineSearch& search, int threads,
                 double* inverse_range, double* std, std::uint8_t* agreeing, std::uint8_t* rivals) {
    std::vector<Arc> others;
    for (int i = 0; i < partners.segments.count; ++i) others.emplace_back(partners.segments, i);
    parallel_rows(segments.count, threads, [&](int i) {
        const Arc mine(segments, i);
        std::vector<Proposal> proposals;
        for (std::size_t other = 0; other < others.size(); ++other) {
            Proposal found{partners.partner[other], {}, {}};
            if (propose(mine, others[other], row(partners.offset, found.partner), search, found))
                proposals.push_back(found);
        }
        inverse_range[2 * i] = inverse_range[2 * i + 1] = std[i] = 0.0;
        agreeing[i] = rivals[i] = 0;
        std::vector<std::uint8_t> counts;
        const Proposal* best = nullptr;
        for (const Proposal& middle : proposals) {
            std::bitset<64> seen;
            double sum[2] = {}, weight[2] = {};
            for (const Proposal& other : proposals) {
                if (!agree(middle, other, search.tolerance)) continue;
                seen.set(other.partner);
                for (int end = 0; end < 2; ++end) {
                    const double precision = 1.0 / (other.std[end] * other.std[end]);
                    sum[end] += precision * other.inverse_range[end];
                    weight[end] += precision;
                }
            }
            counts.push_back(static_cast<std::uint8_t>(seen.count()));
            const double worse = 1.0 / std::sqrt(std::min(weight[0], weight[1]));
            if (counts.back() < agreeing[i] || (counts.back() == agreeing[i] && worse >= std[i])) continue;
            best = &middle, agreeing[i] = counts.back(), std[i] = worse;
            for (int end = 0; end < 2; ++end) inverse_range[2 * i + end] = sum[end] / weight[end];
        }
        for (std::size_t k = 0; k < proposals.size(); ++k)
            if (!agree(*best, proposals[k], search.tolerance)) rivals[i] = std::max(rivals[i], counts[k]);
    });
}

}  // namespace goshawk
