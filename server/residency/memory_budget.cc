#include "server/residency/memory_budget.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/decomposition.h"
#include "core/reconstruct/estimate.h"
#include "core/render/feature_maps.h"
#include "kernels/buffer.h"
#include "kernels/gaussian_planes.h"

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

constexpr auto kFloat = static_cast<int64_t>(sizeof(float));
// Bytes per pixel of the outputs that a segmenter keeps for the next query: colours, alpha and depth,
// a mask before and after its border is refined, and its similarities.
constexpr int64_t kPixelBytes = 3 * kFloat + 2 * kFloat + 2 + kFloat;
constexpr int64_t kFixedHostBytes = 1 << 20;  // views, facts, scale quantiles

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

MemoryBytes BytesOfModel(const Backend& backend, const ModelShape& shape) {
  const int64_t parameters = (NumPlanes(shape.sh_degree) + kFeatureSize + 1) * kFloat;
  constexpr int64_t kDecomposed =
      Decompositions::kMostKept * int64_t{kDefaultDecompositionScales.size()} * kFloat;
  // While a model is read, its features are in memory twice: also in the half floats of the file.
  // It is decomposed only later, so that the larger of the two counts.
  constexpr int64_t kRead = kFeatureSize * static_cast<int64_t>(sizeof(Half));
  const int64_t max_pixels = MostPixels(shape.max_view_pixels);
  ScratchSize scratch = TypicalScratch(shape.num_gaussians, max_pixels);
  // Queries only render; the gradients' memory is for training.
  scratch.for_backward = false;
  MemoryBytes bytes;
  bytes.host = shape.num_gaussians * (parameters + std::max(kDecomposed, kRead)) + kFixedHostBytes;
  bytes.device = shape.num_gaussians * parameters + MapReserve(shape.max_view_pixels) +
                 WithReserve(kPixelBytes * max_pixels) + backend.ScratchBytes(scratch);
  return bytes;
}

}  // namespace pepeseg
