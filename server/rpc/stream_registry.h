#pragma once

#include <condition_variable>
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
  explicit StreamRegistry(absl::Duration tick);
  ~StreamRegistry();
  StreamRegistry(const StreamRegistry&) = delete;
  StreamRegistry& operator=(const StreamRegistry&) = delete;

  // Ends the stream at once when EndAll was called.
  void Add(const std::shared_ptr<Stream>& stream);
  void Remove(Stream* stream);
  void EndAll(const absl::Status& status);
  size_t size() const;

 private:
  void Tick();

  const absl::Duration tick_;
  mutable std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  absl::Status end_status_;  // not OK after EndAll
  // Weak: a stream removes itself, and may be on its way out while it is looked at.
  std::map<Stream*, std::weak_ptr<Stream>> streams_;
  std::thread thread_;
};

}  // namespace pepeseg
