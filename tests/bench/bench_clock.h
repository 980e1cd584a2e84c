#pragma once

#include <sys/resource.h>

#include <chrono>

// The clocks of the programs that measure.
namespace pepeseg {

// Returns the wall clock, seconds from an arbitrary start.
inline double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

inline double NowMs() { return 1e3 * Now(); }

// Returns the processor time of this process (RUSAGE_SELF), or of the programs that it has run
// (RUSAGE_CHILDREN), seconds summed over all cores. Other programs on the machine hardly affect it.
inline double CoreSecondsOf(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}
inline double CoreNow() { return CoreSecondsOf(RUSAGE_SELF); }

}  // namespace pepeseg
