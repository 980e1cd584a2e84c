#pragma once

#include <algorithm>
#include <thread>

namespace pepeseg {

// Returns the number of threads that an option asks for. 0: one for each core.
inline int NumThreads(int asked) {
  return asked > 0 ? asked : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

}  // namespace pepeseg
