// Run work items 0 .. count-1 on a few threads; items are handed out one by one, so uneven ones balance.
#pragma once
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace goshawk {

template <class Work>  // Work(): makes a callable with its own buffers; that callable takes an item's index
void parallel(std::ptrdiff_t count, int threads, const Work& make_worker) {
    std::atomic<std::ptrdiff_t> next{0};
    auto run = [&] {
        auto worker = make_worker();
        for (std::ptrdiff_t i = next++; i < count; i = next++) worker(i);
    };
    std::vector<std::thread> others;
    for (int t = 1; t < threads && t < count; ++t) others.emplace_back(run);
    run();
    for (auto& other : others) other.join();
}

}  // namespace goshawk
