#include "core/query/decomposition.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/query/prompt.h"

namespace pepeseg {
namespace {

// Returns the number of Gaussians of each piece, up to the highest piece; some may have none.
std::vector<int64_t> CountPieces(std::span<const int32_t> pieces) {
  const int32_t last = pieces.empty() ? -1 : *std::max_element(pieces.begin(), pieces.end());
  std::vector<int64_t> counts(static_cast<size_t>(last + 1));
  for (const int32_t piece : pieces) {
    if (piece >= 0) ++counts[piece];
  }
  return counts;
}

// Extends the bounding box of a segment by the mean of a Gaussian.
void Extend(Decomposition::Segment& segment, const Gaussians& gaussians, int64_t gaussian) {
  for (int k = 0; k < 3; ++k) {
    const float at = gaussians.Plane(kMeanPlane + k)[gaussian];
    segment.min[k] = std::min(segment.min[k], at);
    segment.max[k] = std::max(segment.max[k], at);
  }
}

}  // namespace

absl::Status CheckDecompositionScales(std::span<const double> scales) {
  if (scales.empty() || scales.size() > kMaxLevels) {
    return FaultError(
        {"", absl::StrCat(scales.size()), absl::StrCat("scales; allowed are 1..", kMaxLevels)});
  }
  for (size_t i = 0; i < scales.size(); ++i) {
    const std::string part = absl::StrCat("[", i, "]");
    if (!(scales[i] >= 0 && scales[i] <= 1)) {  // also catches NaN
      return FaultError({part, absl::StrCat(scales[i]), "not in [0, 1]"});
    }
    // Levels are built from fine to coarse, each on the one before.
    if (i > 0 && scales[i] <= scales[i - 1]) {
      return FaultError({part, absl::StrCat(scales[i]),
                         absl::StrCat("not over the scale before, ", scales[i - 1])});
    }
  }
  return absl::OkStatus();
}

absl::Status CheckLevel(const Decomposition& decomposition, int level) {
  const auto num_levels = static_cast<int>(decomposition.levels.size());
  if (level >= 0 && level < num_levels) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("level is ", level, ", must be in [0, ", num_levels - 1, "]"));
}

absl::StatusOr<GaussianSet> MembersOf(const Decomposition& decomposition, int level, int32_t id) {
  RETURN_IF_ERROR(CheckLevel(decomposition, level));
  const Decomposition::Level& of = decomposition.levels[level];
  if (id < 1 || id > static_cast<int64_t>(of.segments.size())) {
    return absl::InvalidArgumentError(absl::StrCat("segment is ", id, ", level ", level, " has ",
                                                   of.segments.size(), " segments, from 1"));
  }
  GaussianSet members;
  members.member.reserve(of.ids.size());
  for (const int32_t at : of.ids) members.member.push_back(at == id ? 1 : 0);
  return members;
}

Decomposition::Level LevelOfPieces(double scale, std::span<const int32_t> pieces,
                                   const Gaussians& gaussians) {
  const std::vector<int64_t> counts = CountPieces(pieces);
  std::vector<int32_t> order(counts.size());
  std::iota(order.begin(), order.end(), 0);
  // Ids count from 1, the largest segment first; segments of equal size keep the order of their
  // pieces.
  std::stable_sort(order.begin(), order.end(),
                   [&](int32_t a, int32_t b) { return counts[a] > counts[b]; });
  constexpr float kInf = std::numeric_limits<float>::infinity();
  std::vector<int32_t> id_of_piece(counts.size());
  Decomposition::Level level{scale, std::vector<int32_t>(pieces.size()), {}};
  for (const int32_t piece : order) {
    // Empty pieces come last in this order.
    if (counts[piece] == 0) break;
    level.segments.push_back({0, counts[piece], {kInf, kInf, kInf}, {-kInf, -kInf, -kInf}});
    id_of_piece[piece] = static_cast<int32_t>(level.segments.size());
  }
  for (size_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i] < 0) continue;
    level.ids[i] = id_of_piece[pieces[i]];
    Extend(level.segments[level.ids[i] - 1], gaussians, static_cast<int64_t>(i));
  }
  return level;
}

void SetParents(Decomposition::Level& fine, const Decomposition::Level& coarse) {
  for (size_t i = 0; i < fine.ids.size(); ++i) {
    // Segments nest: all Gaussians of one have the same parent, so the last one may decide.
    if (fine.ids[i] != 0) fine.segments[fine.ids[i] - 1].parent = coarse.ids[i];
  }
}

Decompositions::Entries::iterator Decompositions::Find(std::span<const double> scales) {
  return std::find_if(entries_.begin(), entries_.end(), [scales](const Entry& entry) {
    return std::equal(scales.begin(), scales.end(), entry.scales.begin(), entry.scales.end());
  });
}

absl::StatusOr<Decompositions::Entries::iterator> Decompositions::Get(
    std::span<const double> scales, Make make, std::unique_lock<std::mutex>& lock) {
  // An entry may be gone after waiting, if its `make` failed: it is looked up again.
  auto entry = Find(scales);
  while (entry != entries_.end() && !entry->ready) {
    made_.wait(lock);
    entry = Find(scales);
  }
  if (entry != entries_.end()) {
    entries_.splice(entries_.begin(), entries_, entry);
    return entry;
  }
  entry = entries_.emplace(entries_.begin());
  entry->scales.assign(scales.begin(), scales.end());
  // Others cannot drop the entry, because it is not ready; a list keeps its iterator valid.
  lock.unlock();
  absl::StatusOr<Decomposition> decomposition = make();
  lock.lock();
  // Also after an error: those who wait then make the decomposition themselves.
  made_.notify_all();
  if (!decomposition.ok()) {
    entries_.erase(entry);
    return decomposition.status();
  }
  entry->decomposition = *std::move(decomposition);
  entry->ready = true;
  return entry;
}

void Decompositions::DropOldest() {
  auto num_left = static_cast<int>(entries_.size());
  for (auto entry = entries_.end(); entry != entries_.begin() && num_left > kMostKept;) {
    --entry;
    // Entries in use stay, so that more than kMostKept may be kept for a while.
    if (!entry->ready || entry->num_users > 0) continue;
    entry = entries_.erase(entry);
    --num_left;
  }
}

absl::Status Decompositions::With(std::span<const double> scales, Make make, Use use) {
  std::unique_lock lock(mutex_);
  ASSIGN_OR_RETURN(const auto entry, Get(scales, make, lock));
  ++entry->num_users;
  DropOldest();
  lock.unlock();
  absl::Status status = use(entry->decomposition);
  lock.lock();
  --entry->num_users;
  return status;
}

}  // namespace pepeseg
