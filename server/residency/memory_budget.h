#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "core/query/scene_model.h"

// Memory of host and device that models take: the budget, and who holds how much of it.
namespace pepeseg {

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

// The owner of a value, and the limit on all values of that owner together.
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

// State that a cache and its values share. It lives as long as the last of them.
struct ResidencyState {
  struct Counts {
    int64_t num_loads = 0, num_evictions = 0;
  };
  ResidencyState(const MemoryBudget& budget, std::function<void()> release)
      : release_freed(std::move(release)), ledger(budget) {}

  const std::function<void()> release_freed;  // called after a value was destroyed
  std::mutex mutex;                           // guards all below
  MemoryLedger ledger;
  int64_t clock = 0;
  Counts counts;
};

// A value and its bytes, which are given back when neither a handle nor the cache holds it.
template <typename Value>
struct ResidentValue {
  // The bytes must be taken already.
  ResidentValue(std::shared_ptr<ResidencyState> of, const MemoryBytes& num_bytes, std::string whose)
      : state(std::move(of)), bytes(num_bytes), owner(std::move(whose)) {}
  ResidentValue(const ResidentValue&) = delete;
  ResidentValue& operator=(const ResidentValue&) = delete;
  ~ResidentValue() {
    value.reset();
    if (state->release_freed) state->release_freed();
    const std::lock_guard lock(state->mutex);
    state->ledger.GiveBack(bytes, owner);
  }

  std::shared_ptr<ResidencyState> state;
  MemoryBytes bytes;
  std::string owner;
  std::unique_ptr<Value> value;
};

// Memory taken of a cache's budget for something that is not one of its values. The destructor
// gives it back.
class ReservedMemory {
 public:
  // The bytes must be taken already.
  ReservedMemory(std::shared_ptr<ResidencyState> of, const MemoryBytes& bytes, std::string owner)
      : state_(std::move(of)), bytes_(bytes), owner_(std::move(owner)) {}
  ReservedMemory(const ReservedMemory&) = delete;
  ReservedMemory& operator=(const ReservedMemory&) = delete;
  ~ReservedMemory() {
    const std::lock_guard lock(state_->mutex);
    state_->ledger.GiveBack(bytes_, owner_);
  }

 private:
  const std::shared_ptr<ResidencyState> state_;
  const MemoryBytes bytes_;
  const std::string owner_;
};

}  // namespace pepeseg
