// A* on a grid of distances to obstacles: the shortest way with a price on being near them.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

namespace nb = nanobind;
using Grid = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Path = nb::ndarray<nb::numpy, int64_t, nb::ndim<1>>;

namespace {

struct Step {
    int di, dj, dk;
    int64_t offset;
    float length;
};

std::vector<Step> neighbours(int64_t ny, int64_t nz) {
    std::vector<Step> steps;
    for (int di = -1; di <= 1; ++di)
        for (int dj = -1; dj <= 1; ++dj)
            for (int dk = -1; dk <= 1; ++dk)
                if (di || dj || dk)
                    steps.push_back({di, dj, dk, (di * ny + dj) * nz + dk,
                                     std::sqrt(static_cast<float>(di * di + dj * dj + dk * dk))});
    return steps;
}

// Length of the shortest 26-connected way between two cells of an empty grid: never more than the true one.
float octile(int64_t a, int64_t b, int64_t c) {
    if (a < b) std::swap(a, b);
    if (b < c) std::swap(b, c);
    if (a < b) std::swap(a, b);
    return static_cast<float>(a - b) + 1.41421356f * static_cast<float>(b - c) + 1.73205081f * static_cast<float>(c);
}

// Cells with a distance of at least `required` may be entered; below `comfort` a step costs up to 1 + price as much.
// A way is at most `greed` times as dear as the cheapest one; 1 is exact, more looks at fewer cells.
std::vector<int64_t> astar(const float* distance, int64_t nx, int64_t ny, int64_t nz, int64_t start, int64_t goal,
                           float required, float comfort, float price, float greed) {
    const float infinity = std::numeric_limits<float>::infinity();
    const float scale = comfort > required ? 1.0f / (comfort - required) : 0.0f;
    std::vector<float> cost(static_cast<size_t>(nx * ny * nz), infinity);
    std::vector<int8_t> came(static_cast<size_t>(nx * ny * nz), -1);
    std::vector<bool> done(static_cast<size_t>(nx * ny * nz), false);
    const std::vector<Step> steps = neighbours(ny, nz);
    const int64_t gi = goal / (ny * nz), gj = goal / nz % ny, gk = goal % nz;
    using Entry = std::pair<float, int64_t>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> open;
    const auto estimate = [&](int64_t i, int64_t j, int64_t k) {
        return greed * octile(std::abs(i - gi), std::abs(j - gj), std::abs(k - gk));
    };
    cost[start] = 0.0f;
    open.push({0.0f, start});
    while (!open.empty()) {
        const int64_t cell = open.top().second;
        open.pop();
        if (cell == goal) break;
        const int64_t i = cell / (ny * nz), j = cell / nz % ny, k = cell % nz;
        if (done[cell]) continue;  // opened more than once; the first time was the cheapest, or cheap enough
        done[cell] = true;
        for (size_t s = 0; s < steps.size(); ++s) {
            const Step& step = steps[s];
            const int64_t a = i + step.di, b = j + step.dj, c = k + step.dk;
            if (a < 0 || b < 0 || c < 0 || a >= nx || b >= ny || c >= nz) continue;
            const int64_t next = cell + step.offset;
            if (done[next]) continue;
            const float d = distance[next];
            if (!(d >= required)) continue;
            const float lack = std::max(0.0f, (comfort - d) * scale);
            const float reached = cost[cell] + step.length * (1.0f + price * lack * lack);
            if (reached >= cost[next]) continue;
            cost[next] = reached;
            came[next] = static_cast<int8_t>(s);
            open.push({reached + estimate(a, b, c), next});
        }
    }
    std::vector<int64_t> path;
    if (!std::isfinite(cost[goal])) return path;
    for (int64_t cell = goal; cell != start; cell -= steps[came[cell]].offset) path.push_back(cell);
    path.push_back(start);
    std::reverse(path.begin(), path.end());
    return path;
}

// The least distance on the way whose least distance is largest (a bottleneck path, best first); its cell, or -1 where
// no way leads through known cells.
int64_t bottleneck_cell(const float* distance, int64_t nx, int64_t ny, int64_t nz, int64_t start, int64_t goal) {
    std::vector<bool> seen(static_cast<size_t>(nx * ny * nz), false);
    const std::vector<Step> steps = neighbours(ny, nz);
    std::priority_queue<std::pair<float, int64_t>> open;
    open.push({distance[start], start});
    seen[start] = true;
    int64_t narrowest = start;
    while (!open.empty()) {
        const auto [room, cell] = open.top();
        open.pop();
        if (room < distance[narrowest]) narrowest = cell;
        if (cell == goal) return narrowest;
        const int64_t i = cell / (ny * nz), j = cell / nz % ny, k = cell % nz;
        for (const Step& step : steps) {
            const int64_t a = i + step.di, b = j + step.dj, c = k + step.dk;
            if (a < 0 || b < 0 || c < 0 || a >= nx || b >= ny || c >= nz) continue;
            const int64_t next = cell + step.offset;
            if (seen[next] || !std::isfinite(distance[next])) continue;
            seen[next] = true;
            open.push({distance[next], next});
        }
    }
    return -1;
}

}  // namespace

int64_t bottleneck(Grid distance, int64_t start, int64_t goal) {
    nb::gil_scoped_release release;
    return bottleneck_cell(distance.data(), static_cast<int64_t>(distance.shape(0)),
                           static_cast<int64_t>(distance.shape(1)), static_cast<int64_t>(distance.shape(2)), start,
                           goal);
}

Path search(Grid distance, int64_t start, int64_t goal, float required, float comfort, float price, float greed) {
    auto* found = new std::vector<int64_t>();
    nb::capsule owner(found, [](void* p) noexcept { delete static_cast<std::vector<int64_t>*>(p); });
    {
        nb::gil_scoped_release release;
        *found =
            astar(distance.data(), static_cast<int64_t>(distance.shape(0)), static_cast<int64_t>(distance.shape(1)),
                  static_cast<int64_t>(distance.shape(2)), start, goal, required, comfort, price, greed);
    }
    return Path(found->data(), {found->size()}, owner);
}

void bind_search(nb::module_& m) {
    m.def("bottleneck", &bottleneck, nb::arg("distance"), nb::arg("start"), nb::arg("goal"),
          "Cell of the least distance on the way from start to goal that has most room; -1 if there is no way.");
    m.def("search", &search, nb::arg("distance"), nb::arg("start"), nb::arg("goal"), nb::arg("required"),
          nb::arg("comfort"), nb::arg("price"), nb::arg("greed"),
          "Cells (flat indices) of the cheapest way from start to goal; empty if there is none.");
}
