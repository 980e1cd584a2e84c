#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "server/residency/memory_budget.h"

namespace pepeseg {

// What a cache and its values share. It lives as long as the last of them.
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
