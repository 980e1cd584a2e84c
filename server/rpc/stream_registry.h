#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <thread>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg {

class Stream;

// The streams that are open: ends all of them when the server stops, and wakes each now and then
// so that it can send a heartbeat. One thread for all of them instead of an alarm for each. Thread
// safe.
class StreamRegistry {
 public:
  // `max_streams`: those beyond are ended at once.
  StreamRegistry(absl::Duration tick, size_t max_streams);
  ~StreamRegistry();
  StreamRegistry(const StreamRegistry&) = delete;
  StreamRegistry& operator=(const StreamRegistry&) = delete;

  // Ends the stream at once when EndAll was called (with its status), while the server drains
  // (UNAVAILABLE), and when there are too many (RESOURCE_EXHAUSTED).
  void Add(const std::shared_ptr<Stream>& stream);
  void Remove(Stream* stream);
  void EndAll(const absl::Status& status);
  // New ones are refused; those that are open go on.
  void SetDraining(bool draining);
  size_t size() const;
  int64_t num_refused() const;

 private:
  absl::Status AdmitLocked() const;
  void Tick();

  const absl::Duration tick_;
  const size_t max_streams_;
  mutable std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  bool draining_ = false;
  int64_t num_refused_ = 0;
  absl::Status end_status_;  // not OK after EndAll
  // Weak: a stream removes itself, and may be on its way out while it is looked at.
  std::map<Stream*, std::weak_ptr<Stream>> streams_;
  std::thread thread_;
};

}  // namespace pepeseg
