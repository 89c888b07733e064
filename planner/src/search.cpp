// A* on a grid of distances to obstacles: the shortest way with a price on being near them.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
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
    int8_t number;

    int square() const { return di * di + dj * dj + dk * dk; }
};

std::vector<Step> neighbours(int64_t ny, int64_t nz) {
    std::vector<Step> steps;
    for (int di = -1; di <= 1; ++di)
        for (int dj = -1; dj <= 1; ++dj)
            for (int dk = -1; dk <= 1; ++dk)
                if (di || dj || dk)
                    steps.push_back({di, dj, dk, (di * ny + dj) * nz + dk,
                                     std::sqrt(static_cast<float>(di * di + dj * dj + dk * dk)),
                                     static_cast<int8_t>(steps.size())});
    return steps;
}

// For each step into a cell, the steps worth trying from there: to where the others lead, the cell before is no
// farther, and tried it. The last list has all of them, for the cell that the search starts from.
std::vector<std::vector<Step>> onward(const std::vector<Step>& steps) {
    std::vector<std::vector<Step>> lists;
    for (const Step& came : steps) {
        lists.emplace_back();
        for (const Step& next : steps)
            if (2 * (came.di * next.di + came.dj * next.dj + came.dk * next.dk) + came.square() > 0)
                lists.back().push_back(next);
    }
    lists.push_back(steps);
    return lists;
}

// Length of the shortest 26-connected way between two cells of an empty grid: never more than the true one.
float octile(int64_t a, int64_t b, int64_t c) {
    const int64_t most = std::max({a, b, c}), least = std::min({a, b, c}), middle = a + b + c - most - least;
    return static_cast<float>(most - middle) + 1.41421356f * static_cast<float>(middle - least) +
           1.73205081f * static_cast<float>(least);
}

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr int8_t kSteps = 26;

struct Cell {
    float price = kInfinity;  // factor on the length of a step into it; infinite where none may be made (any more)
    float cost = kInfinity;   // of the cheapest way known
    int8_t came = kSteps;     // by which step
};

// Cells in order of the cost of a way through them, to a 64th of a step; among equals the last one in comes first.
class Queue {
  public:
    void push(float cost, int64_t cell) {
        const auto row = static_cast<size_t>(64.0f * cost);
        if (row >= last_.size()) last_.resize(row + 1, kNone);
        entries_.push_back({cell, last_[row]});
        last_[row] = entries_.size() - 1;
        first_ = std::min(first_, row);
    }
    // The next cell, or -1 where there is none.
    int64_t pop() {
        while (first_ < last_.size() && last_[first_] == kNone) ++first_;
        if (first_ == last_.size()) return -1;
        const Entry& entry = entries_[last_[first_]];
        last_[first_] = entry.before;
        return entry.cell;
    }

  private:
    struct Entry {
        int64_t cell;
        size_t before;  // the entry that came into the same row before this one
    };
    static constexpr size_t kNone = std::numeric_limits<size_t>::max();
    std::vector<Entry> entries_;
    std::vector<size_t> last_;  // of each row
    size_t first_ = 0;
};

// Cells with a distance of at least `required` may be entered; below `comfort` a step costs up to 1 + price as much,
// and in each cell by `dearer` of its length more, if that is given. A way is at most `greed` times as dear as the
// cheapest one; 1 is exact, more looks at fewer cells.
std::vector<int64_t> astar(const float* distance, int64_t nx, int64_t ny, int64_t nz, int64_t start, int64_t goal,
                           float required, float comfort, float price, float greed, const float* dearer) {
    const float scale = comfort > required ? 1.0f / (comfort - required) : 0.0f;
    // With a layer of cells that cannot be entered all round, no step needs to ask whether it leaves the grid.
    const int64_t my = ny + 2, mz = nz + 2;
    std::vector<Cell> cells(static_cast<size_t>((nx + 2) * my * mz));
    for (int64_t i = 0; i < nx; ++i)
        for (int64_t j = 0; j < ny; ++j)
            for (int64_t k = 0; k < nz; ++k) {
                const int64_t cell = (i * ny + j) * nz + k;
                const float d = distance[cell];
                if (!(d >= required)) continue;
                const float lack = std::max(0.0f, (comfort - d) * scale);
                const float more = dearer ? dearer[cell] : 0.0f;
                cells[((i + 1) * my + j + 1) * mz + k + 1].price = 1.0f + price * lack * lack + more;
            }
    const auto padded = [&](int64_t cell) {
        return ((cell / (ny * nz) + 1) * my + cell / nz % ny + 1) * mz + cell % nz + 1;
    };
    const std::vector<Step> steps = neighbours(my, mz);
    const std::vector<std::vector<Step>> lists = onward(steps);
    const int64_t first = padded(start), last = padded(goal);
    const int64_t gi = last / (my * mz), gj = last / mz % my, gk = last % mz;
    Queue open;
    cells[first].cost = 0.0f;
    open.push(0.0f, first);
    for (int64_t here = open.pop(); here >= 0 && here != last; here = open.pop()) {
        if (here != first && cells[here].price == kInfinity) continue;  // the first time was cheap enough
        cells[here].price = kInfinity;
        const int64_t i = here / (my * mz), j = here / mz % my, k = here % mz;
        for (const Step& step : lists[cells[here].came]) {
            Cell& next = cells[here + step.offset];
            const float reached = cells[here].cost + step.length * next.price;
            if (reached >= next.cost) continue;
            next.cost = reached;
            next.came = step.number;
            const float left =
                octile(std::abs(i + step.di - gi), std::abs(j + step.dj - gj), std::abs(k + step.dk - gk));
            open.push(reached + greed * left, here + step.offset);
        }
    }
    std::vector<int64_t> path;
    if (cells[last].cost == kInfinity) return path;
    for (int64_t cell = last;; cell -= steps[cells[cell].came].offset) {
        path.push_back(((cell / (my * mz) - 1) * ny + cell / mz % my - 1) * nz + cell % mz - 1);
        if (cell == first) break;
    }
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

Path search(Grid distance, int64_t start, int64_t goal, float required, float comfort, float price, float greed,
            std::optional<Grid> dearer) {
    auto* found = new std::vector<int64_t>();
    nb::capsule owner(found, [](void* p) noexcept { delete static_cast<std::vector<int64_t>*>(p); });
    {
        nb::gil_scoped_release release;
        *found = astar(distance.data(), static_cast<int64_t>(distance.shape(0)),
                       static_cast<int64_t>(distance.shape(1)), static_cast<int64_t>(distance.shape(2)), start, goal,
                       required, comfort, price, greed, dearer ? dearer->data() : nullptr);
    }
    return Path(found->data(), {found->size()}, owner);
}

void bind_search(nb::module_& m) {
    m.def("bottleneck", &bottleneck, nb::arg("distance"), nb::arg("start"), nb::arg("goal"),
          "Cell of the least distance on the way from start to goal that has most room; -1 if there is no way.");
    m.def("search", &search, nb::arg("distance"), nb::arg("start"), nb::arg("goal"), nb::arg("required"),
          nb::arg("comfort"), nb::arg("price"), nb::arg("greed"), nb::arg("dearer") = nb::none(),
          "Cells (flat indices) of the cheapest way from start to goal; empty if there is none.");
}
