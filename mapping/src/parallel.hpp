// Splits a range of rows over threads. The work on a row must not depend on any other row, so that the result does not
// depend on the number of threads.
#pragma once
#include <atomic>
#include <thread>
#include <vector>

namespace goshawk {

template <typename Work>
void parallel_rows(int rows, int threads, Work work) {
    std::atomic<int> next{0};
    auto loop = [&] {
        for (int row = next++; row < rows; row = next++) work(row);
    };
    std::vector<std::thread> helpers;
    for (int i = 1; i < threads; ++i) helpers.emplace_back(loop);
    loop();
    for (auto& helper : helpers) helper.join();
}

}  // namespace goshawk
