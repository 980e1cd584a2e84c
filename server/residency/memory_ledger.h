#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "server/residency/memory_budget.h"

namespace pepeseg {

// Whose a value is, and what all of theirs may take together, in the memory of which they take
// more; 0: no limit.
struct MemoryShare {
  std::string owner;
  int64_t limit = 0;
  // What is told when they would take `need`.
  std::function<absl::Status(int64_t need)> error;
};

// What is taken of a budget, and by whom; bytes as the budget counts them. Not thread safe.
class MemoryLedger {
 public:
  explicit MemoryLedger(const MemoryBudget& budget) : budget_(budget) {}

  void Take(const MemoryBytes& bytes, const std::string& owner);
  // What was taken.
  void GiveBack(const MemoryBytes& bytes, const std::string& owner);

  const MemoryBudget& budget() const { return budget_; }
  const MemoryBytes& used() const { return used_; }
  MemoryBytes UsedBy(const std::string& owner) const;

 private:
  const MemoryBudget budget_;
  MemoryBytes used_;
  std::map<std::string, MemoryBytes> used_by_;  // owners of anything
};

}  // namespace pepeseg
