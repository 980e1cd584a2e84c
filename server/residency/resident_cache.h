#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {

// Values that are costly to load and big to keep, by key, under a byte budget: loaded on demand,
// one load at a time for a key however many ask, the least recently used one evicted that nobody
// holds. A handle keeps its value alive, and its bytes counted, also when the key was dropped
// meanwhile. Thread safe; Acquire blocks while a value is loaded.
template <typename Value>
class ResidentCache {
 public:
  using Handle = std::shared_ptr<const Value>;
  using Loader = std::function<absl::StatusOr<std::unique_ptr<Value>>()>;

  explicit ResidentCache(int64_t budget_bytes) : state_(std::make_shared<State>(budget_bytes)) {}

  // `num_bytes`: what the value will take, reserved before the load. RESOURCE_EXHAUSTED, with need
  // and have, when that much does not come free; a load's error is told to all who waited for it,
  // and the next one who asks tries again.
  absl::StatusOr<Handle> Acquire(const std::string& key, int64_t num_bytes, const Loader& load);
  // The next Acquire of it loads anew.
  void Drop(const std::string& key);

  int64_t bytes_in_use() const {
    const std::lock_guard lock(state_->mutex);
    return state_->used;
  }

 private:
  struct State {
    explicit State(int64_t bytes) : budget(bytes) {}
    const int64_t budget;
    std::mutex mutex;
    int64_t used = 0;  // by values alive and loads under way, bytes
    int64_t clock = 0;
  };
  // A value and its bytes: given back when the last handle and the cache have let it go.
  struct Resident {
    Resident(std::shared_ptr<State> owner, int64_t num_bytes)
        : state(std::move(owner)), bytes(num_bytes) {}
    Resident(const Resident&) = delete;
    Resident& operator=(const Resident&) = delete;
    ~Resident() {
      value.reset();
      const std::lock_guard lock(state->mutex);
      state->used -= bytes;
    }
    std::shared_ptr<State> state;
    int64_t bytes;
    std::unique_ptr<Value> value;
  };
  // One for each key that is loaded or being loaded.
  struct Entry {
    std::shared_ptr<Resident> resident;  // null while it is being loaded
    absl::Status error;
    bool loading = true;
    int64_t last_use = 0;
  };

  std::shared_ptr<Entry> Evictable();
  absl::Status Reserve(int64_t num_bytes, std::unique_lock<std::mutex>& lock);
  static Handle HandleOf(const std::shared_ptr<Resident>& resident) {
    return Handle(resident, resident->value.get());
  }

  const std::shared_ptr<State> state_;
  std::condition_variable loaded_;
  std::map<std::string, std::shared_ptr<Entry>> entries_;  // guarded by state_->mutex
};

// The least recently used entry that is loaded and that nobody holds.
template <typename Value>
std::shared_ptr<typename ResidentCache<Value>::Entry> ResidentCache<Value>::Evictable() {
  std::shared_ptr<Entry> oldest;
  for (const auto& [key, entry] : entries_) {
    if (entry->loading || entry->resident.use_count() != 1) continue;
    if (oldest == nullptr || entry->last_use < oldest->last_use) oldest = entry;
  }
  return oldest;
}

template <typename Value>
absl::Status ResidentCache<Value>::Reserve(int64_t num_bytes, std::unique_lock<std::mutex>& lock) {
  while (state_->used + num_bytes > state_->budget) {
    const std::shared_ptr<Entry> entry = Evictable();
    if (entry == nullptr) {
      return absl::ResourceExhaustedError(
          absl::StrCat("needs ", num_bytes, " bytes, ", state_->budget - state_->used, " of ",
                       state_->budget, " are free or could be freed"));
    }
    std::erase_if(entries_, [&](const auto& pair) { return pair.second == entry; });
    std::shared_ptr<Resident> evicted = std::move(entry->resident);
    lock.unlock();  // its destructor gives the bytes back
    evicted.reset();
    lock.lock();
  }
  state_->used += num_bytes;
  return absl::OkStatus();
}

template <typename Value>
absl::StatusOr<typename ResidentCache<Value>::Handle> ResidentCache<Value>::Acquire(
    const std::string& key, int64_t num_bytes, const Loader& load) {
  std::unique_lock lock(state_->mutex);
  for (auto found = entries_.find(key); found != entries_.end(); found = entries_.find(key)) {
    const std::shared_ptr<Entry> other = found->second;
    loaded_.wait(lock, [&] { return !other->loading; });
    if (!other->error.ok()) return other->error;
    if (other->resident == nullptr) continue;  // evicted again before this thread woke
    other->last_use = ++state_->clock;
    return HandleOf(other->resident);
  }
  const auto entry = std::make_shared<Entry>();
  entries_[key] = entry;
  absl::Status status = Reserve(num_bytes, lock);
  std::shared_ptr<Resident> resident;
  if (status.ok()) {
    lock.unlock();
    resident = std::make_shared<Resident>(state_, num_bytes);
    auto value = load();
    status = value.status();
    if (value.ok()) resident->value = *std::move(value);
    if (!status.ok()) resident.reset();
    lock.lock();
  }
  entry->loading = false;
  entry->error = status;
  entry->resident = resident;
  entry->last_use = ++state_->clock;
  loaded_.notify_all();
  if (status.ok()) return HandleOf(resident);
  // Unless it was dropped, and asked for again, meanwhile.
  if (const auto mine = entries_.find(key); mine != entries_.end() && mine->second == entry) {
    entries_.erase(mine);
  }
  return status;
}

template <typename Value>
void ResidentCache<Value>::Drop(const std::string& key) {
  std::shared_ptr<Entry> dropped;  // outlives the lock: its destructor takes it
  const std::lock_guard lock(state_->mutex);
  const auto found = entries_.find(key);
  if (found == entries_.end()) return;
  dropped = std::move(found->second);
  entries_.erase(found);
}

}  // namespace pepeseg
