#pragma once

#include <cassert>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "kernels/backend.h"

namespace pepeseg {

// Small results of a device, read without stopping it: Push queues a copy of a span as it then
// stands, Pop gives the oldest copy and waits only where it has not arrived. The host may so be
// Backend::queue_depth() steps ahead, always the same number: what it decides from the results does
// not depend on how fast anything runs. One thread at a time; the backend must outlive it.
template <class T>
class ReadbackQueue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // Of `size` elements each; at most `capacity` under way.
  ReadbackQueue(Backend& backend, int64_t size, int capacity)
      : backend_(backend), size_(size), tickets_(static_cast<size_t>(capacity)) {
    pinned_ = static_cast<T*>(backend.AllocatePinned(tickets_.size() * BytesOfOne()));
  }
  ~ReadbackQueue() {
    if (pinned_ != nullptr) backend_.FreePinned(pinned_);
  }
  ReadbackQueue(const ReadbackQueue&) = delete;
  ReadbackQueue& operator=(const ReadbackQueue&) = delete;

  bool allocated() const { return pinned_ != nullptr; }
  int64_t num_pending() const { return num_pushed_ - num_popped_; }

  void Push(DeviceSpan<const T> span) {
    assert(span.size == size_ && num_pending() < static_cast<int64_t>(tickets_.size()));
    const size_t slot = Slot(num_pushed_++);
    tickets_[slot] = backend_.CopyToHostLater(At(slot), span.data, BytesOfOne());
  }
  // Valid until as many pushes as the capacity.
  std::span<const T> Pop() {
    assert(num_pending() > 0);
    const size_t slot = Slot(num_popped_++);
    backend_.WaitFor(tickets_[slot]);
    return {At(slot), static_cast<size_t>(size_)};
  }

 private:
  size_t BytesOfOne() const { return static_cast<size_t>(size_) * sizeof(T); }
  size_t Slot(int64_t number) const { return static_cast<size_t>(number) % tickets_.size(); }
  T* At(size_t slot) const { return pinned_ + slot * static_cast<size_t>(size_); }

  Backend& backend_;
  const int64_t size_;
  std::vector<int64_t> tickets_;
  T* pinned_ = nullptr;
  int64_t num_pushed_ = 0, num_popped_ = 0;
};

}  // namespace pepeseg
