#include "server/residency/memory_budget.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kMarginOf = 20;  // one of 20 bytes stays free

absl::Status CheckKind(const char* kind, int64_t need, int64_t used, int64_t usable) {
  // `used` may leave out what can be evicted, hence "could be freed".
  if (used + need <= usable) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat("needs ", need, " bytes of ", kind, " memory, ",
                                                   usable - used, " of ", usable,
                                                   " are free or could be freed"));
}

}  // namespace

MemoryBudget::MemoryBudget(const MemoryBytes& limit, bool one_memory)
    : usable_{limit.host - limit.host / kMarginOf,
              one_memory ? 0 : limit.device - limit.device / kMarginOf},
      one_memory_(one_memory) {}

MemoryBytes MemoryBudget::Counted(const MemoryBytes& bytes) const {
  return one_memory_ ? MemoryBytes{bytes.host + bytes.device, 0} : bytes;
}

bool MemoryBudget::Fits(const MemoryBytes& used, const MemoryBytes& need) const {
  return Check(used, need).ok();
}

absl::Status MemoryBudget::Check(const MemoryBytes& used, const MemoryBytes& need) const {
  const MemoryBytes counted = Counted(need);
  RETURN_IF_ERROR(CheckKind("host", counted.host, used.host, usable_.host));
  return CheckKind("device", counted.device, used.device, usable_.device);
}

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
  // Projects come and go, so owners of nothing are not kept.
  if (theirs.host == 0 && theirs.device == 0) used_by_.erase(owner);
}

MemoryBytes MemoryLedger::UsedBy(const std::string& owner) const {
  const auto theirs = used_by_.find(owner);
  return theirs == used_by_.end() ? MemoryBytes() : theirs->second;
}

}  // namespace pepeseg
