#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>
#include <vector>

namespace pepeseg {

// Calls work(i) once for each i < count, on up to 16 threads of this machine, and returns when all
// calls have. The calls must not depend on each other.
template <class Work>
void OnThreads(size_t count, const Work& work) {
  const size_t num_threads =
      std::min(count, std::clamp<size_t>(std::thread::hardware_concurrency(), 1, 16));
  std::vector<std::jthread> threads;
  threads.reserve(num_threads);
  for (size_t t = 0; t < num_threads; ++t) {
    threads.emplace_back([&, t] {
      for (size_t i = t; i < count; i += num_threads) work(i);
    });
  }
}

}  // namespace pepeseg
