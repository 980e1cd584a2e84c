#include "server/services/model_devices.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "core/base/errors.h"

namespace pepeseg {
namespace {

int64_t FreeBytes(const ModelDevice& device) {
  const MemoryBudget& budget = device.cache->budget();
  const MemoryBytes used = device.cache->bytes_in_use();
  return budget.one_memory() ? budget.usable().host - used.host
                             : budget.usable().device - used.device;
}

// Keeps the error that says most: a device whose models are in use may have room later.
void KeepError(const absl::Status& error, absl::Status& kept) {
  if (kept.ok() || absl::IsUnavailable(error)) kept = error;
}

}  // namespace

// An UNAVAILABLE of the database is private and says nothing about memory.
bool IsNoRoom(const absl::Status& status) {
  return absl::IsResourceExhausted(status) || (absl::IsUnavailable(status) && !IsPrivate(status));
}

std::vector<size_t> ModelDevices::ByFreeMemory() const {
  std::vector<size_t> order(devices_.size());
  std::iota(order.begin(), order.end(), size_t{0});
  if (order.size() == 1) return order;
  std::vector<int64_t> free;
  for (const ModelDevice& device : devices_) free.push_back(FreeBytes(device));
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return free[a] > free[b]; });
  return order;
}

// Returns the devices in the order in which to try them: first the one that holds the key.
std::vector<size_t> ModelDevices::BeginPlacing(const std::string& key) {
  const std::lock_guard lock(mutex_);
  Placing& placing = placings_[key];
  if (++placing.num_calls == 1) placing.order = ByFreeMemory();
  std::vector<size_t> order = placing.order;
  std::stable_partition(order.begin(), order.end(),
                        [&](size_t device) { return devices_[device].cache->Holds(key); });
  return order;
}

void ModelDevices::EndPlacing(const std::string& key) {
  const std::lock_guard lock(mutex_);
  const auto placing = placings_.find(key);
  if (--placing->second.num_calls == 0) placings_.erase(placing);
}

absl::StatusOr<ModelDevices::Handle> ModelDevices::Acquire(const std::string& key,
                                                           SourceOn source) {
  absl::StatusOr<Handle> loaded;
  absl::Status no_room;
  for (const size_t device : BeginPlacing(key)) {
    loaded = devices_[device].cache->Acquire(key, source(devices_[device]));
    if (!IsNoRoom(loaded.status())) break;
    KeepError(loaded.status(), no_room);
    loaded = no_room;
  }
  EndPlacing(key);
  return loaded;
}

absl::StatusOr<std::unique_ptr<ReservedMemory>> ModelDevices::TakeMemory(const MemoryBytes& need,
                                                                         ShareOn share) {
  std::vector<size_t> order = ByFreeMemory();
  if (need.device > 0) order = {0};
  absl::Status no_room;
  for (const size_t device : order) {
    const absl::StatusOr<MemoryShare> of_owner = share(devices_[device]);
    if (!of_owner.ok()) return of_owner.status();
    auto taken = devices_[device].cache->TakeMemory(need, *of_owner);
    if (!IsNoRoom(taken.status())) return taken;
    KeepError(taken.status(), no_room);
  }
  return no_room;
}

void ModelDevices::Drop(const std::string& key) {
  for (const ModelDevice& device : devices_) device.cache->Drop(key);
}

// Two calls that meet may load one model to two devices, so all are asked.
absl::Status ModelDevices::ForHolder(absl::FunctionRef<absl::Status(ModelCache&)> change) {
  absl::Status result = absl::NotFoundError("it is not resident");
  for (const ModelDevice& device : devices_) {
    const absl::Status status = change(*device.cache);
    if (absl::IsNotFound(result) || !(status.ok() || absl::IsNotFound(status))) result = status;
  }
  return result;
}

absl::Status ModelDevices::Unload(const std::string& key) {
  return ForHolder([&](ModelCache& cache) { return cache.Unload(key); });
}

absl::Status ModelDevices::SetPinned(const std::string& key, bool pinned) {
  return ForHolder([&](ModelCache& cache) { return cache.SetPinned(key, pinned); });
}

void ModelDevices::Visit(
    absl::FunctionRef<void(const ModelDevice&, const ModelCache::Info&, const SceneModel&)> visit)
    const {
  for (const ModelDevice& device : devices_) {
    device.cache->Visit(
        [&](const ModelCache::Info& info, const SceneModel& model) { visit(device, info, model); });
  }
}

int64_t ModelDevices::BytesOf(const std::string& owner, const ModelDevice* except) const {
  int64_t bytes = 0;
  for (const ModelDevice& device : devices_) {
    if (&device != except) bytes += device.cache->BytesOf(owner);
  }
  return bytes;
}

}  // namespace pepeseg
