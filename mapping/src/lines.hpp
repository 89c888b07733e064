// Line segments of one image put into depth by those of its partners (after Hofer, Maurer and Bischof, "Efficient 3D
// scene abstraction using line segments", 2017).
#pragma once
#include <cstdint>

#include "vec3.hpp"

namespace goshawk {

// Segments of images. Directions are unit vectors from the image's camera, in world axes; the lighter side of every
// segment lies on the same hand of the way from its first end to its last.
struct Segments {
    int count;
    const double* first;  // (count, 3)
    const double* last;   // (count, 3)
};

struct Partners {
    Segments segments;
    const std::int32_t* partner;  // (count) which partner each segment is of, below 64
    int count;                    // of partners
    const double* offset;         // (count, 3) from the reference camera to the partner's, metres, not 0
};

struct LineSearch {
    double std_rad;    // standard deviation of an end of a segment, across it
    double tolerance;  // depths agree when they differ by at most this many standard deviations
    double nearest_m;
    double farthest_m;            // of interest: of what is farther away only that is found out
    double largest_relative_std;  // of one partner's inverse range
    double least_overlap;         // share of the shorter of two segments that the other covers
};

// Every segment of a partner that may show the same line proposes an inverse range of either end; those proposals that
// most partners agree on win. `inverse_range` (n, 2) 1/m, 0 or less beyond infinity; `std` (n) of the worse end, 1/m;
// `agreeing` (n) partners, 0 where none proposes any; `rivals` (n) partners that agree on another depth, at most.
void sweep_lines(const Segments& segments, const Partners& partners, const LineSearch& search, int threads,
                 double* inverse_range, double* std, std::uint8_t* agreeing, std::uint8_t* rivals);

}  // namespace goshawk
