#include "server/residency/memory_budget.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kMarginOf = 20;  // one of so many bytes stays free

absl::Status CheckKind(const char* kind, int64_t need, int64_t used, int64_t usable) {
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

}  // namespace pepeseg
