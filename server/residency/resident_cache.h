#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/base/status_macros.h"
#include "server/residency/memory_budget.h"

namespace pepeseg {

// A cache of values that are slow to load and large, by key, within a byte budget. Values are
// loaded on demand; callers who ask for one key at the same time share one load. To make room, the
// least recently used value is evicted that is neither pinned nor held by a handle. A handle keeps
// its value alive, and its bytes counted, even after the key was dropped. Thread safe: one mutex
// guards all state and is not held during a load. Acquire blocks while a value is loaded.
template <typename Value>
class ResidentCache {
 public:
  using Handle = std::shared_ptr<const Value>;
  using Share = MemoryShare;
  // Where a value comes from. Its functions are called without a lock, and only if the value is not
  // resident.
  struct Source {
    std::string name, owner;  // for Visit
    // Returns the most that the value will take, which is reserved before the load.
    std::function<absl::StatusOr<MemoryBytes>()> need;
    std::function<absl::StatusOr<std::unique_ptr<Value>>()> load;
    std::function<absl::StatusOr<Share>()> share = {};  // empty: the value has no owner
  };
  struct Info {
    const std::string &name, &owner;
    MemoryBytes bytes;
    bool pinned;
    absl::Time last_use;
    int64_t num_handles;
  };
  using Counts = ResidencyState::Counts;

  // `release_freed` is called after a value was destroyed, before its bytes count as free.
  explicit ResidentCache(const MemoryBudget& budget, std::function<void()> release_freed = {})
      : state_(std::make_shared<ResidencyState>(budget, std::move(release_freed))) {}

  // Returns the value of a key, loaded if it is not resident. If the owner exceeds its share, only
  // values of this owner are evicted. Errors, after which nothing was evicted:
  //   UNAVAILABLE, with the bytes needed and available: values in use leave too little room for
  //   now. RESOURCE_EXHAUSTED, or the share's error: the value would not fit even without the
  //   values in use; only unpinning can help.
  // An error of the source is returned to all callers who waited for this load; the next call tries
  // again.
  absl::StatusOr<Handle> Acquire(const std::string& key, const Source& source);
  // Returns whether the value of a key is resident or being loaded.
  bool Holds(const std::string& key) const {
    const std::lock_guard lock(state_->mutex);
    return entries_.contains(key);
  }
  // Reserves `need` for something that is not a value, in the way in which Acquire reserves memory
  // for a value, with the same errors.
  absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeMemory(const MemoryBytes& need,
                                                             const Share& share) {
    RETURN_IF_ERROR(Reserve(need, share));
    return std::make_unique<ReservedMemory>(state_, need, share.owner);
  }
  // Removes a value whose source is gone, even if it is pinned. The next Acquire loads it again.
  void Drop(const std::string& key);
  // Removes a value. FAILED_PRECONDITION: it is pinned. NOT_FOUND: it is not resident.
  absl::Status Unload(const std::string& key);
  // Pins or unpins a value; a pinned value is never evicted. NOT_FOUND: it is not resident.
  absl::Status SetPinned(const std::string& key, bool pinned);
  // Calls `visit` with each resident value, in the order of keys. `visit` must not use the cache.
  void Visit(absl::FunctionRef<void(const Info&, const Value&)> visit) const;

  // Returns the bytes of values that are alive or being loaded. If the budget has one memory, those
  // of the device are part of `host`.
  MemoryBytes bytes_in_use() const;
  // Returns the bytes of an owner's values as they count against its share.
  int64_t BytesOf(const std::string& owner) const;
  Counts counts() const;
  const MemoryBudget& budget() const { return state_->ledger.budget(); }

 private:
  using Resident = ResidentValue<Value>;
  // The state of a key that is loaded or being loaded.
  struct Entry {
    std::string name, owner;
    std::shared_ptr<Resident> resident;  // null while it is being loaded
    absl::Status error;
    bool loading = true;
    bool pinned = false;
    int64_t last_use = 0;
    absl::Time last_use_time;
  };
  using Entries = std::map<std::string, std::shared_ptr<Entry>>;

  static bool IsEvictable(const Entry& entry) {
    return !entry.loading && !entry.pinned && entry.resident.use_count() == 1;
  }
  // Returns what the values of share.owner take together with `need`; with `without_evictable`,
  // after the eviction of all that can be evicted.
  int64_t TakenWith(const MemoryBytes& need, const Share& share, bool without_evictable) const;
  // Returns the bytes of pinned values, which only an operator can free. nullptr: of any owner.
  MemoryBytes PinnedBytes(const std::string* owner) const;
  // Returns the least recently used entry that can be evicted. nullptr: of any owner.
  typename Entries::iterator Oldest(const std::string* owner);
  // Returns the entry to evict next so that `need` fits, or entries_.end() if it fits already.
  absl::StatusOr<typename Entries::iterator> NextToGo(const MemoryBytes& need, const Share& share);
  absl::Status ShareError(const MemoryBytes& need, const Share& share, int64_t least) const;
  static absl::Status InUse(const absl::Status& full) {
    return absl::UnavailableError(
        absl::StrCat(full.message(), "; values in use take the rest for now"));
  }
  absl::Status Reserve(const MemoryBytes& need, const Share& share);
  absl::StatusOr<std::shared_ptr<Resident>> Load(const Source& source);
  absl::StatusOr<typename Entries::iterator> FindLoaded(const std::string& key);
  Handle Use(Entry& entry) {
    entry.last_use = ++state_->clock;
    entry.last_use_time = absl::Now();
    return Handle(entry.resident, entry.resident->value.get());
  }

  const std::shared_ptr<ResidencyState> state_;
  std::condition_variable loaded_, left_;
  // Guarded by state_->mutex.
  Entries entries_;
  int num_leaving_ = 0;  // values whose eviction is in progress
};

template <typename Value>
typename ResidentCache<Value>::Entries::iterator ResidentCache<Value>::Oldest(
    const std::string* owner) {
  auto oldest = entries_.end();
  for (auto at = entries_.begin(); at != entries_.end(); ++at) {
    if (!IsEvictable(*at->second)) continue;
    if (owner != nullptr && at->second->resident->owner != *owner) continue;
    if (oldest == entries_.end() || at->second->last_use < oldest->second->last_use) oldest = at;
  }
  return oldest;
}

template <typename Value>
int64_t ResidentCache<Value>::TakenWith(const MemoryBytes& need, const Share& share,
                                        bool without_evictable) const {
  MemoryBytes taken = budget().Counted(need);
  taken += state_->ledger.UsedBy(share.owner);
  for (const auto& [key, entry] : entries_) {
    if (without_evictable && IsEvictable(*entry) && entry->resident->owner == share.owner) {
      taken -= budget().Counted(entry->resident->bytes);
    }
  }
  return std::max(taken.host, taken.device);
}

template <typename Value>
MemoryBytes ResidentCache<Value>::PinnedBytes(const std::string* owner) const {
  MemoryBytes pinned;
  for (const auto& [key, entry] : entries_) {
    if (entry->loading || !entry->pinned) continue;
    if (owner != nullptr && entry->resident->owner != *owner) continue;
    pinned += budget().Counted(entry->resident->bytes);
  }
  return pinned;
}

// `least`: what the owner's values would take after all evictions that are possible now, bytes.
template <typename Value>
absl::Status ResidentCache<Value>::ShareError(const MemoryBytes& need, const Share& share,
                                              int64_t least) const {
  MemoryBytes always = budget().Counted(need);
  always += PinnedBytes(&share.owner);
  const absl::Status error = share.error(least);
  return std::max(always.host, always.device) > share.limit ? error : InUse(error);
}

template <typename Value>
absl::StatusOr<typename ResidentCache<Value>::Entries::iterator> ResidentCache<Value>::NextToGo(
    const MemoryBytes& need, const Share& share) {
  const bool in_share = share.limit == 0 || TakenWith(need, share, false) <= share.limit;
  const bool fits = budget().Fits(state_->ledger.used(), need);
  if (in_share && fits) return entries_.end();
  // Share and budget are both checked before anything is evicted.
  if (!in_share) {
    const int64_t least = TakenWith(need, share, true);
    if (least > share.limit) return ShareError(need, share, least);
  }
  if (!fits) {
    MemoryBytes kept = state_->ledger.used();
    for (const auto& [key, entry] : entries_) {
      if (IsEvictable(*entry)) kept -= budget().Counted(entry->resident->bytes);
    }
    const absl::Status full = budget().Check(kept, need);
    if (!full.ok() && budget().Fits(PinnedBytes(nullptr), need)) return InUse(full);
    RETURN_IF_ERROR(full);
  }
  return Oldest(in_share ? nullptr : &share.owner);
}

template <typename Value>
absl::Status ResidentCache<Value>::Reserve(const MemoryBytes& need, const Share& share) {
  std::unique_lock lock(state_->mutex);
  while (true) {
    const auto next = NextToGo(need, share);
    if (!next.ok() && num_leaving_ > 0) {  // evictions in progress will free more
      left_.wait(lock);
      continue;
    }
    RETURN_IF_ERROR(next.status());
    if (*next == entries_.end()) break;
    std::shared_ptr<Resident> evicted = std::move((*next)->second->resident);
    entries_.erase(*next);
    ++state_->counts.num_evictions;
    ++num_leaving_;
    lock.unlock();  // the value's destructor locks the mutex to give its bytes back
    evicted.reset();
    lock.lock();
    --num_leaving_;
    left_.notify_all();
  }
  state_->ledger.Take(need, share.owner);
  return absl::OkStatus();
}

template <typename Value>
absl::StatusOr<std::shared_ptr<typename ResidentCache<Value>::Resident>> ResidentCache<Value>::Load(
    const Source& source) {
  ASSIGN_OR_RETURN(const MemoryBytes need, source.need());
  Share share;
  if (source.share) {
    ASSIGN_OR_RETURN(share, source.share());
  }
  RETURN_IF_ERROR(Reserve(need, share));
  const auto resident = std::make_shared<Resident>(state_, need, share.owner);
  ASSIGN_OR_RETURN(resident->value, source.load());
  return resident;
}

template <typename Value>
absl::StatusOr<typename ResidentCache<Value>::Handle> ResidentCache<Value>::Acquire(
    const std::string& key, const Source& source) {
  std::unique_lock lock(state_->mutex);
  for (auto found = entries_.find(key); found != entries_.end(); found = entries_.find(key)) {
    const std::shared_ptr<Entry> other = found->second;
    loaded_.wait(lock, [&] { return !other->loading; });
    if (!other->error.ok()) return other->error;
    if (other->resident == nullptr) continue;  // evicted again before this thread woke up
    return Use(*other);
  }
  const auto entry = std::make_shared<Entry>();
  entry->name = source.name;
  entry->owner = source.owner;
  entries_[key] = entry;
  lock.unlock();
  auto resident = Load(source);
  lock.lock();
  entry->loading = false;
  entry->error = resident.status();
  loaded_.notify_all();
  if (resident.ok()) {
    ++state_->counts.num_loads;
    entry->resident = *std::move(resident);
    return Use(*entry);
  }
  // The key may have been dropped and requested again in the meantime: then the entry is another.
  if (const auto mine = entries_.find(key); mine != entries_.end() && mine->second == entry) {
    entries_.erase(mine);
  }
  return entry->error;
}

template <typename Value>
void ResidentCache<Value>::Drop(const std::string& key) {
  std::shared_ptr<Entry> dropped;  // destroyed after the lock, which its destructor takes
  const std::lock_guard lock(state_->mutex);
  const auto found = entries_.find(key);
  if (found == entries_.end()) return;
  dropped = std::move(found->second);
  entries_.erase(found);
}

template <typename Value>
absl::StatusOr<typename ResidentCache<Value>::Entries::iterator> ResidentCache<Value>::FindLoaded(
    const std::string& key) {
  const auto found = entries_.find(key);
  if (found != entries_.end() && !found->second->loading) return found;
  return absl::NotFoundError("it is not resident");
}

template <typename Value>
absl::Status ResidentCache<Value>::Unload(const std::string& key) {
  std::shared_ptr<Entry> unloaded;  // as in Drop
  const std::lock_guard lock(state_->mutex);
  ASSIGN_OR_RETURN(const auto found, FindLoaded(key));
  if (found->second->pinned) return absl::FailedPreconditionError("it is pinned");
  unloaded = std::move(found->second);
  entries_.erase(found);
  return absl::OkStatus();
}

template <typename Value>
absl::Status ResidentCache<Value>::SetPinned(const std::string& key, bool pinned) {
  const std::lock_guard lock(state_->mutex);
  ASSIGN_OR_RETURN(const auto found, FindLoaded(key));
  found->second->pinned = pinned;
  return absl::OkStatus();
}

template <typename Value>
void ResidentCache<Value>::Visit(absl::FunctionRef<void(const Info&, const Value&)> visit) const {
  const std::lock_guard lock(state_->mutex);
  for (const auto& [key, entry] : entries_) {
    if (entry->loading) continue;
    const std::shared_ptr<Resident>& resident = entry->resident;
    visit({entry->name, entry->owner, resident->bytes, entry->pinned, entry->last_use_time,
           resident.use_count() - 1},
          *resident->value);
  }
}

template <typename Value>
MemoryBytes ResidentCache<Value>::bytes_in_use() const {
  const std::lock_guard lock(state_->mutex);
  return state_->ledger.used();
}

template <typename Value>
int64_t ResidentCache<Value>::BytesOf(const std::string& owner) const {
  const std::lock_guard lock(state_->mutex);
  return TakenWith({}, {owner, 0, {}}, false);
}

template <typename Value>
typename ResidentCache<Value>::Counts ResidentCache<Value>::counts() const {
  const std::lock_guard lock(state_->mutex);
  return state_->counts;
}

}  // namespace pepeseg
