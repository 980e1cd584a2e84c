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

// Limits on streams. Each stream costs memory and some work at every tick.
struct StreamLimits {
  size_t max_streams = 4096;
  // Maximum number of one project, on a server with keys, and of one peer, which is an address or
  // the subject that a gateway names. They keep one client from taking the streams of all others.
  size_t max_per_project = 1024;
  size_t max_per_peer = 1024;
  // Time from the begin of a stream to the first message of its client.
  absl::Duration first_message = absl::Seconds(10);
  // Time that the reader of an export may take for a message.
  absl::Duration stuck_export = absl::Seconds(60);
};

// The owner of a stream. An empty name has no limit.
struct StreamOwner {
  std::string project;
  std::string peer;
};
// Returns the owner of a call's stream. In-process channels and Unix sockets have no peer, since
// their clients are on this machine.
StreamOwner OwnerOf(const Caller& caller, const CallOrigin& origin);

// The streams that are open. Counts them against their limits, ends all of them when the server
// stops, and wakes each at every tick, so that it can send a heartbeat: one thread for all streams
// instead of an alarm for each. Thread safe.
class StreamRegistry {
 public:
  // `tick`: time between two wake-ups of a stream.
  StreamRegistry(absl::Duration tick, const StreamLimits& limits);
  ~StreamRegistry();
  StreamRegistry(const StreamRegistry&) = delete;
  StreamRegistry& operator=(const StreamRegistry&) = delete;

  // Adds a stream whose caller is not known yet. Ends it at once if EndAll was called (with the
  // status of that call), if the server drains (UNAVAILABLE), or if 4,096 streams wait to be
  // admitted (RESOURCE_EXHAUSTED).
  void Add(const std::shared_ptr<Stream>& stream);
  // Counts a stream whose caller was authorised. Call once for a stream. RESOURCE_EXHAUSTED: there
  // are too many streams in all, of its project or of its peer; the caller ends the stream with it.
  absl::Status Admit(Stream* stream, const StreamOwner& owner);
  void Remove(Stream* stream);
  void EndAll(const absl::Status& status);
  // While it drains, new streams are refused; open ones continue.
  void SetDraining(bool draining);
  size_t size() const;
  int64_t num_refused() const;
  const StreamLimits& limits() const { return limits_; }

 private:
  struct Entry {
    // Weak: the list does not keep a stream alive, which owns itself until Stream::Done().
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
