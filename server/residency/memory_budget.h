#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"

namespace pepeseg {

// Bytes of the host's memory and of the device's memory.
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

// How much of the two memories may be reserved: 95 % of each limit. The rest is left for memory
// that is not counted, such as the scratch of queries and the gaps between blocks.
class MemoryBudget {
 public:
  // `one_memory`: the device is the host. Then both kinds are counted against limit.host, and
  // limit.device is not used.
  MemoryBudget(const MemoryBytes& limit, bool one_memory);

  // Returns how much may be reserved.
  MemoryBytes usable() const { return usable_; }
  bool one_memory() const { return one_memory_; }
  // Returns `bytes` as they are counted against usable().
  MemoryBytes Counted(const MemoryBytes& bytes) const;
  // Returns whether `need` can be reserved in addition to `used`, which is as Counted() returns it.
  bool Fits(const MemoryBytes& used, const MemoryBytes& need) const;
  // Returns RESOURCE_EXHAUSTED with the bytes needed and available if Fits() would return false.
  absl::Status Check(const MemoryBytes& used, const MemoryBytes& need) const;

 private:
  MemoryBytes usable_;
  bool one_memory_;
};

// Whose a value is, and how much all values of that owner may take together.
struct MemoryShare {
  std::string owner;
  int64_t limit = 0;  // bytes of the memory in which the owner takes more; 0: unlimited
  // Makes the error for an owner who would take `need` bytes.
  std::function<absl::Status(int64_t need)> error;
};

// Counts what is taken of a budget, in all and by owner. Bytes are counted as the budget counts
// them. Not thread safe.
class MemoryLedger {
 public:
  explicit MemoryLedger(const MemoryBudget& budget) : budget_(budget) {}

  void Take(const MemoryBytes& bytes, const std::string& owner);
  // Gives back bytes that were taken for the owner.
  void GiveBack(const MemoryBytes& bytes, const std::string& owner);

  const MemoryBudget& budget() const { return budget_; }
  const MemoryBytes& used() const { return used_; }
  MemoryBytes UsedBy(const std::string& owner) const;

 private:
  const MemoryBudget budget_;
  MemoryBytes used_;
  std::map<std::string, MemoryBytes> used_by_;  // has only owners who have taken something
};

}  // namespace pepeseg
