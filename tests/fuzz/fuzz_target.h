#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "absl/strings/string_view.h"

// A fuzz target is a function of bytes that nobody has vouched for; it must come back, whatever
// they are, and aborts where what it finds cannot be. Built for libFuzzer (PEPESEG_FUZZ) each is a
// program; else all of them are in one test, which replays the files of tests/fuzz/corpus/NAME.
//
//   PEPESEG_FUZZ_TARGET(npy) { ... bytes ... }
namespace pepeseg::fuzz {

using Target = void (*)(absl::string_view bytes);

// By name; filled before main().
std::map<std::string, Target>& Targets();
bool AddTarget(const char* name, Target target);

// Aborts, with the words: what is expected of the code under test does not hold.
void Expect(bool holds, const char* what);

}  // namespace pepeseg::fuzz

#ifdef PEPESEG_FUZZ
#define PEPESEG_FUZZ_TARGET(name)                                           \
  static void FuzzBytes(absl::string_view bytes);                           \
  extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) { \
    FuzzBytes({reinterpret_cast<const char*>(data), size});                 \
    return 0;                                                               \
  }                                                                         \
  static void FuzzBytes(absl::string_view bytes)
#else
#define PEPESEG_FUZZ_TARGET(name)                                                            \
  static void FuzzBytes(absl::string_view bytes);                                            \
  [[maybe_unused]] static const bool is_known = pepeseg::fuzz::AddTarget(#name, &FuzzBytes); \
  static void FuzzBytes(absl::string_view bytes)
#endif
