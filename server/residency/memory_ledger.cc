#include "server/residency/memory_ledger.h"

namespace pepeseg {

void MemoryLedger::Take(const MemoryBytes& bytes, const std::string& owner) {
  const MemoryBytes counted = budget_.Counted(bytes);
  used_ += counted;
  used_by_[owner] += counted;
}

void MemoryLedger::GiveBack(const MemoryBytes& bytes, const std::string& owner) {
  const MemoryBytes counted = budget_.Counted(bytes);
  used_ -= counted;
  MemoryBytes& theirs = used_by_[owner];
  theirs -= counted;
  if (theirs.host == 0 && theirs.device == 0) used_by_.erase(owner);
}

MemoryBytes MemoryLedger::UsedBy(const std::string& owner) const {
  const auto theirs = used_by_.find(owner);
  return theirs == used_by_.end() ? MemoryBytes() : theirs->second;
}

}  // namespace pepeseg
