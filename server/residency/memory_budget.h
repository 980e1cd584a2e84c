#pragma once

#include <cstdint>

#include "absl/status/status.h"

namespace pepeseg {

// Bytes of the host's memory and of the device's.
struct MemoryBytes {
  int64_t host = 0, device = 0;

  MemoryBytes& operator+=(const MemoryBytes& other) {
    host += other.host;
    device += other.device;
    return *this;
  }
  MemoryBytes& operator-=(const MemoryBytes& other) {
    host -= other.host;
    device -= other.device;
    return *this;
  }
};

// How much of the two memories may be reserved: the limits but for 5 %, which are left for what
// nobody counts, as the questions' own scratch and the gaps between blocks.
class MemoryBudget {
 public:
  // `one_memory`: the device is the host, both come out of limit.host; limit.device is not used.
  MemoryBudget(const MemoryBytes& limit, bool one_memory);

  // What may be reserved.
  MemoryBytes usable() const { return usable_; }
  bool one_memory() const { return one_memory_; }
  // `bytes` as they are counted against usable().
  MemoryBytes Counted(const MemoryBytes& bytes) const;
  // Whether `need` more can be reserved where `used`, as counted, is.
  bool Fits(const MemoryBytes& used, const MemoryBytes& need) const;
  // RESOURCE_EXHAUSTED, with need and have of the memory that is short, where it does not fit.
  absl::Status Check(const MemoryBytes& used, const MemoryBytes& need) const;

 private:
  MemoryBytes usable_;
  bool one_memory_;
};

}  // namespace pepeseg
