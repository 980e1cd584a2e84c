#include "core/decompose/decompositions.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/base/status_macros.h"

namespace pepeseg {

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
