#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/query/scene_model.h"
#include "kernels/backend.h"
#include "server/residency/resident_cache.h"

namespace pepeseg {

using ModelCache = ResidentCache<SceneModel>;

// A device with models in its memory, which computes the queries of these.
struct ModelDevice {
  std::string id, name;  // Device::id, Device::name
  Backend& backend;
  std::unique_ptr<ModelCache> cache;
};

// The caches of all devices as one: a model is in the memory of one device at a time. Thread safe.
class ModelDevices {
 public:
  using Handle = ModelCache::Handle;
  // Returns the source of a model for a device.
  using SourceOn = absl::FunctionRef<ModelCache::Source(const ModelDevice&)>;
  using ShareOn = absl::FunctionRef<absl::StatusOr<MemoryShare>(const ModelDevice&)>;

  explicit ModelDevices(std::vector<ModelDevice> devices) : devices_(std::move(devices)) {}

  // Returns a model from the device that has it or is loading it. Else it loads it to the device
  // with the most free memory or, if that has no room, to the next. Errors are those of
  // ResidentCache::Acquire, where no room on any device is UNAVAILABLE if it is on one of them.
  absl::StatusOr<Handle> Acquire(const std::string& key, SourceOn source);
  // Reserves memory as ResidentCache::TakeMemory does: on the first device if `need` has device
  // bytes, else on the first in the order of Acquire that has room.
  absl::StatusOr<std::unique_ptr<ReservedMemory>> TakeMemory(const MemoryBytes& need,
                                                             ShareOn share);
  // As in ResidentCache, on whichever device holds the key.
  void Drop(const std::string& key);
  absl::Status Unload(const std::string& key);
  absl::Status SetPinned(const std::string& key, bool pinned);
  void Visit(absl::FunctionRef<void(const ModelDevice&, const ModelCache::Info&, const SceneModel&)>
                 visit) const;

  // Returns the bytes of an owner's values on all devices but `except`, which may be nullptr.
  int64_t BytesOf(const std::string& owner, const ModelDevice* except = nullptr) const;
  const std::vector<ModelDevice>& all() const { return devices_; }

 private:
  // A key for which calls of Acquire are under way. They try the devices in one order, so that they
  // share loads, and errors.
  struct Placing {
    std::vector<size_t> order;
    int num_calls = 0;
  };
  std::vector<size_t> BeginPlacing(const std::string& key);
  void EndPlacing(const std::string& key);
  // Returns the indices of all devices, those with the most free memory first.
  std::vector<size_t> ByFreeMemory() const;
  absl::Status ForHolder(absl::FunctionRef<absl::Status(ModelCache&)> change);

  const std::vector<ModelDevice> devices_;
  std::mutex mutex_;  // guards placings_; not held during a load
  std::map<std::string, Placing> placings_;
};

// Returns whether there was no room for a model, or its project has no room left: another device
// may have.
bool IsNoRoom(const absl::Status& status);

}  // namespace pepeseg
