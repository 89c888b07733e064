// Normal random numbers whose bits depend on seed, flight and stream alone: neither on threads nor on other flights.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "portable.hpp"

namespace goshawk {

// xoshiro256++ (Blackman and Vigna 2021), seeded by splitmix64.
class Random {
  public:
    Random(std::uint64_t seed, std::uint64_t flight, std::uint64_t stream) {
        std::uint64_t x =
            seed * 0x9e3779b97f4a7c15ULL + flight * 0xd1342543de82ef95ULL + stream * 0xaf251af3b0f025b5ULL;
        for (std::uint64_t& s : state_) s = mixed(x);
    }

    double normal() {
        if (has_spare_) {
            has_spare_ = false;
            return spare_;
        }
        const double length = std::sqrt(-2.0 * logarithm(1.0 - uniform()));  // Box and Muller 1958
        const SineCosine turn = sine_cosine(2.0 * kPi * uniform());
        spare_ = length * turn.sine;
        has_spare_ = true;
        return length * turn.cosine;
    }

    // In [0, 1).
    double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }

  private:
    static std::uint64_t mixed(std::uint64_t& x) {
        std::uint64_t z = (x += 0x9e3779b97f4a7c15ULL);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
        return z ^ (z >> 31);
    }

    static std::uint64_t turned(std::uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }

    std::uint64_t next() {
        std::uint64_t* s = state_;
        const std::uint64_t result = turned(s[0] + s[3], 23) + s[0], t = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= t;
        s[3] = turned(s[3], 45);
        return result;
    }

    std::uint64_t state_[4];
    double spare_ = 0.0;
    bool has_spare_ = false;
};

// Normal numbers that are the weighted sum of several streams': of variance one if the weights' squares add to one.
class Mixture {
  public:
    // Of `count` flights' streams; those of weight zero are left out.
    Mixture(std::uint64_t seed, const std::uint64_t* flights, const double* weights, std::size_t count,
            std::uint64_t stream) {
        for (std::size_t i = 0; i < count; ++i) {
            if (weights[i] == 0.0) continue;
            streams_.emplace_back(seed, flights[i], stream);
            weights_.push_back(weights[i]);
        }
    }

    double normal() {
        double sum = 0.0;
        for (std::size_t i = 0; i < streams_.size(); ++i) sum += weights_[i] * streams_[i].normal();
        return sum;
    }

  private:
    std::vector<Random> streams_;
    std::vector<double> weights_;
};

}  // namespace goshawk
