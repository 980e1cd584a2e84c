#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

namespace pepeseg {

// Objects whose memory later calls use again: allocating megabytes in each step would cost more
// than many ops do, because the system clears fresh pages. From any thread.
template <class T>
class Reusable {
 public:
  using Handle = std::unique_ptr<T, std::function<void(T*)>>;

  // Returns an object in the state in which a call left it, or a new one. The handle gives it back;
  // this must outlive it.
  Handle Take() {
    std::unique_ptr<T> object;
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        object = std::move(free_.back());
        free_.pop_back();
      }
    }
    if (object == nullptr) object = std::make_unique<T>();
    return Handle(object.release(),
                  [this](T* returned) { GiveBack(std::unique_ptr<T>(returned)); });
  }

 private:
  void GiveBack(std::unique_ptr<T> object) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(object));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<T>> free_;
};

// Returns memory for `size` values, which a call before may have left there. A vector keeps the
// greatest size that it had.
template <class T>
T* Reserve(std::vector<T>& memory, int64_t size) {
  if (static_cast<int64_t>(memory.size()) < size) memory.resize(size);
  return memory.data();
}

// Working memory of a PairLoss.
struct PairMemory {
  std::vector<float> unit, unit_by_channel, unit_grad;
  std::vector<uint16_t> bits;
};

}  // namespace pepeseg
