#include "lines.hpp"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <numeric>
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
    const double length = angle[1] - angle[0];  // negative: light and dark are exchanged; above half a turn: behind it
    const double common = std::min(angle[1], other.extent) - std::max(angle[0], 0.0);
    return length > 0.0 && length < M_PI && common > search.least_overlap * std::min(length, other.extent);
}

bool agree(const Proposal& a, const Proposal& b, double tolerance) {
    for (int end = 0; end < 2; ++end)
        if (std::abs(a.inverse_range[end] - b.inverse_range[end]) > tolerance * std::hypot(a.std[end], b.std[end]))
            return false;
    return true;
}

// The segments of one partner by their angle round the way to it. A line in space has the same angles from both
// cameras, whatever its range: only segments that share some of them can be of one line.
class Sectors {
  public:
    explicit Sectors(Vec3 offset) : segments_(count) {
        const double m[3] = {std::abs(offset.x), std::abs(offset.y), std::abs(offset.z)};
        const Vec3 other = m[0] <= m[1] && m[0] <= m[2] ? Vec3{1, 0, 0} : m[1] <= m[2] ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
        across_ = normalised(cross(offset, other));
        up_ = normalised(cross(offset, across_));
    }
    void add(const Arc& arc, int segment) {
        each(arc, [&](int sector) { segments_[sector].push_back(segment); });
    }
    void append(const Arc& arc, std::vector<int>& found) const {
        each(arc, [&](int sector) { found.insert(found.end(), segments_[sector].begin(), segments_[sector].end()); });
    }

  private:
    static constexpr int count = 720;
    double angle(Vec3 direction) const { return std::atan2(dot(direction, up_), dot(direction, across_)); }

    template <typename Work>
    void each(const Arc& arc, Work work) const {
        const double first = angle(arc.first), turn = std::remainder(angle(arc.last) - first, 2.0 * M_PI);
        if (!std::isfinite(turn)) return;  // no direction, or cameras at one place: there is no angle
        const double scale = count / (2.0 * M_PI), low = scale * (std::min(first, first + turn) + 2.0 * M_PI);
        const int last = static_cast<int>(low + scale * std::abs(turn));
        for (int sector = static_cast<int>(low); sector <= last; ++sector) work(sector % count);
    }

    std::vector<std::vector<int>> segments_;
    Vec3 across_, up_;
};

// The proposals that agree with one of them, itself included.
struct Support {
    std::bitset<64> partners;
    double sum[2] = {}, weight[2] = {};  // of the inverse ranges, by their precision

    void add(const Proposal& other) {
        partners.set(other.partner);
        for (int end = 0; end < 2; ++end) {
            const double precision = 1.0 / (other.std[end] * other.std[end]);
            sum[end] += precision * other.inverse_range[end];
            weight[end] += precision;
        }
    }
};

// Only proposals whose intervals of the first end's inverse range overlap can agree: those are found in order.
std::vector<Support> supports(const std::vector<Proposal>& proposals, double tolerance) {
    const auto low = [&](int k) { return proposals[k].inverse_range[0] - tolerance * proposals[k].std[0]; };
    std::vector<int> order(proposals.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](int a, int b) { return low(a) < low(b); });
    std::vector<Support> result(proposals.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
        const Proposal& middle = proposals[order[i]];
        const double high = middle.inverse_range[0] + tolerance * middle.std[0];
        result[order[i]].add(middle);
        for (std::size_t k = i + 1; k < order.size() && low(order[k]) <= high; ++k) {
            if (!agree(middle, proposals[order[k]], tolerance)) continue;
            result[order[i]].add(proposals[order[k]]);
            result[order[k]].add(middle);
        }
    }
    return result;
}

}  // namespace

void sweep_lines(const Segments& segments, const Partners& partners, const LineSearch& search, int threads,
                 double* inverse_range, double* std, std::uint8_t* agreeing, std::uint8_t* rivals) {
    std::vector<Arc> others;
    std::vector<Sectors> sectors;
    for (int i = 0; i < partners.count; ++i) sectors.emplace_back(row(partners.offset, i));
    for (int i = 0; i < partners.segments.count; ++i) {
        others.emplace_back(partners.segments, i);
        sectors[partners.partner[i]].add(others.back(), i);
    }
    parallel_rows(segments.count, threads, [&](int i) {
        const Arc mine(segments, i);
        std::vector<int> candidates;
        for (const Sectors& of_partner : sectors) of_partner.append(mine, candidates);
        std::sort(candidates.begin(), candidates.end());
        candidates.erase(std::unique(candidates.begin(), candidates.end()), candidates.end());
        std::vector<Proposal> proposals;
        for (int other : candidates) {
            Proposal found{partners.partner[other], {}, {}};
            if (propose(mine, others[other], row(partners.offset, found.partner), search, found))
                proposals.push_back(found);
        }
        inverse_range[2 * i] = inverse_range[2 * i + 1] = std[i] = 0.0;
        agreeing[i] = rivals[i] = 0;
        const std::vector<Support> support = supports(proposals, search.tolerance);
        const Proposal* best = nullptr;
        for (std::size_t k = 0; k < proposals.size(); ++k) {
            const Support& own = support[k];
            const auto count = static_cast<std::uint8_t>(own.partners.count());
            const double worse = 1.0 / std::sqrt(std::min(own.weight[0], own.weight[1]));
            if (count < agreeing[i] || (count == agreeing[i] && worse >= std[i])) continue;
            best = &proposals[k], agreeing[i] = count, std[i] = worse;
            for (int end = 0; end < 2; ++end) inverse_range[2 * i + end] = own.sum[end] / own.weight[end];
        }
        for (std::size_t k = 0; k < proposals.size(); ++k)
            if (!agree(*best, proposals[k], search.tolerance))
                rivals[i] = std::max(rivals[i], static_cast<std::uint8_t>(support[k].partners.count()));
    });
}

}  // namespace goshawk
