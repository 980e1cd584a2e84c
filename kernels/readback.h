#pragma once

#include <cassert>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "kernels/backend.h"

namespace pepeseg {

// Reads small results of a device without stopping it. Push queues a copy of a span as the ops
// called so far leave it; Pop returns the oldest copy and blocks only until it has arrived. The
// host can so be Backend::queue_depth() steps ahead. Since that number is fixed, what the host
// decides from the results does not depend on timing. One thread at a time. The backend must
// outlive it.
template <class T>
class ReadbackQueue {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  // Holds at most `capacity` copies (1..kMaxReadbacks) of `size` elements. Check allocated() before
  // the first Push.
  ReadbackQueue(Backend& backend, int64_t size, int capacity)
      : backend_(backend), size_(size), tickets_(static_cast<size_t>(capacity)) {
    pinned_ = static_cast<T*>(backend.AllocatePinned(tickets_.size() * BytesOfOne()));
  }
  ~ReadbackQueue() {
    if (pinned_ != nullptr) backend_.FreePinned(pinned_);
  }
  ReadbackQueue(const ReadbackQueue&) = delete;
  ReadbackQueue& operator=(const ReadbackQueue&) = delete;

  // False: there was no memory for the copies, and Push must not be called.
  bool allocated() const { return pinned_ != nullptr; }
  // Number of copies pushed and not yet popped.
  int64_t num_pending() const { return num_pushed_ - num_popped_; }

  // Queues a copy of `span`, which has `size` elements. num_pending() must be below the capacity.
  void Push(DeviceSpan<const T> span) {
    assert(span.size == size_ && num_pending() < static_cast<int64_t>(tickets_.size()));
    const size_t slot = Slot(num_pushed_++);
    tickets_[slot] = backend_.CopyToHostLater(At(slot), span.data, BytesOfOne());
  }
  // Returns the oldest copy; num_pending() must be above 0. The span is valid until `capacity`
  // copies after it have been pushed. After an error of the backend its contents are unspecified.
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
