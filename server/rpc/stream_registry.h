#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace pepeseg {

struct Caller;
struct CallOrigin;
class Stream;

// What streams may take. Each costs memory, and a look at its job every tick.
struct StreamLimits {
  size_t max_streams = 4096;
  // Of one project of a server with keys, and of one peer: its address, or the subject that a
  // gateway names. So none can take what others need.
  size_t max_per_project = 1024;
  size_t max_per_peer = 1024;
  // From a stream's begin until its client has sent the first message.
  absl::Duration first_message = absl::Seconds(10);
  // For the reader of an export to take a message.
  absl::Duration stuck_export = absl::Seconds(60);
};

// Whose a stream is; an empty name has no bound.
struct StreamOwner {
  std::string project;
  std::string peer;
};
// In-process and Unix sockets are no peers: who can use them is on this machine.
StreamOwner OwnerOf(const Caller& caller, const CallOrigin& origin);

// The streams that are open: ends all of them when the server stops, and wakes each now and then
// so that it can send a heartbeat. One thread for all of them instead of an alarm for each. Thread
// safe.
class StreamRegistry {
 public:
  // `tick`: between two looks at a stream.
  StreamRegistry(absl::Duration tick, const StreamLimits& limits);
  ~StreamRegistry();
  StreamRegistry(const StreamRegistry&) = delete;
  StreamRegistry& operator=(const StreamRegistry&) = delete;

  // A stream whose caller is not known yet, which its first Work() finds out. Ends it at once when
  // EndAll was called (with its status), while the server drains (UNAVAILABLE), and when 4,096 more
  // than those admitted are in that state (RESOURCE_EXHAUSTED).
  void Add(const std::shared_ptr<Stream>& stream);
  // Its caller is known and may call: from now on it counts. RESOURCE_EXHAUSTED: there are too many
  // in all, of its project or of its peer; end it with that. Once for a stream.
  absl::Status Admit(Stream* stream, const StreamOwner& owner);
  void Remove(Stream* stream);
  void EndAll(const absl::Status& status);
  // New ones are refused; those that are open go on.
  void SetDraining(bool draining);
  size_t size() const;
  int64_t num_refused() const;
  const StreamLimits& limits() const { return limits_; }

 private:
  struct Entry {
    // Weak: a stream removes itself, and may be on its way out while it is looked at.
    std::weak_ptr<Stream> stream;
    bool admitted = false;
    StreamOwner owner = {};
  };
  using Counts = std::map<std::string, size_t>;

  absl::Status MayWaitLocked() const;
  absl::Status MayOpenLocked(const StreamOwner& owner) const;
  void CountLocked(const StreamOwner& owner);
  void WarnLocked(const std::string& whose, size_t count, size_t limit);
  void Tick();

  const absl::Duration tick_;
  const StreamLimits limits_;
  mutable std::mutex mutex_;
  std::condition_variable stop_;
  bool stopping_ = false;
  bool draining_ = false;
  int64_t num_refused_ = 0;
  absl::Status end_status_;  // not OK after EndAll
  std::map<Stream*, Entry> streams_;
  size_t num_admitted_ = 0;
  Counts by_project_, by_peer_;  // of those admitted
  absl::Time last_warning_ = absl::InfinitePast();
  std::thread thread_;
};

}  // namespace pepeseg
