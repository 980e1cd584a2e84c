#include "server/rpc/stream_registry.h"

#include <vector>

#include "server/rpc/error.h"
#include "server/rpc/stream.h"

namespace pepeseg {

StreamRegistry::StreamRegistry(absl::Duration tick, size_t max_streams)
    : tick_(tick), max_streams_(max_streams), thread_([this] { Tick(); }) {}

StreamRegistry::~StreamRegistry() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  thread_.join();
}

void StreamRegistry::Add(const std::shared_ptr<Stream>& stream) {
  absl::Status status;
  {
    const std::lock_guard lock(mutex_);
    status = AdmitLocked();
    streams_[stream.get()] = stream;
    if (!status.ok()) ++num_refused_;
  }
  if (!status.ok()) stream->End(status);
}

absl::Status StreamRegistry::AdmitLocked() const {
  if (!end_status_.ok()) return end_status_;
  if (draining_) return DrainingError();
  return streams_.size() < max_streams_ ? absl::OkStatus() : TooManyStreamsError(max_streams_);
}

void StreamRegistry::SetDraining(bool draining) {
  const std::lock_guard lock(mutex_);
  draining_ = draining;
}

int64_t StreamRegistry::num_refused() const {
  const std::lock_guard lock(mutex_);
  return num_refused_;
}

void StreamRegistry::Remove(Stream* stream) {
  const std::lock_guard lock(mutex_);
  streams_.erase(stream);
}

void StreamRegistry::EndAll(const absl::Status& status) {
  std::vector<std::shared_ptr<Stream>> streams;
  {
    const std::lock_guard lock(mutex_);
    end_status_ = status;
    for (const auto& [address, weak] : streams_) streams.push_back(weak.lock());
  }
  for (const auto& stream : streams) {
    if (stream != nullptr) stream->End(status);
  }
}

size_t StreamRegistry::size() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

// A part of them at a time: all at once would keep questions waiting.
void StreamRegistry::Tick() {
  constexpr uintptr_t kParts = 16;
  constexpr uintptr_t kSpread = 64;  // bytes, less than any stream takes
  uintptr_t part = 0;
  std::unique_lock lock(mutex_);
  while (!stop_.wait_for(lock, absl::ToChronoMicroseconds(tick_ / kParts),
                         [this] { return stopping_; })) {
    part = (part + 1) % kParts;
    std::vector<std::shared_ptr<Stream>> streams;
    for (const auto& [address, weak] : streams_) {
      const auto place = reinterpret_cast<uintptr_t>(address) / kSpread;
      if (place % kParts == part) streams.push_back(weak.lock());
    }
    lock.unlock();
    for (const auto& stream : streams) {
      if (stream != nullptr) stream->Wake();
    }
    streams.clear();  // may destroy streams, which must not happen under the mutex
    lock.lock();
  }
}

}  // namespace pepeseg
