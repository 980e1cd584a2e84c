#include "server/rpc/stream_registry.h"

#include <spdlog/spdlog.h>

#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/access/authorizer.h"
#include "server/api/error.h"
#include "server/rpc/stream.h"

namespace pepeseg {
namespace {

// Maximum number of streams whose callers are not known yet. It takes only a look at their keys.
constexpr size_t kMaxUnknown = 4096;
constexpr absl::Duration kStreamWarningInterval = absl::Minutes(1);

absl::Status CheckBound(const std::map<std::string, size_t>& counts, const std::string& name,
                        size_t limit, const char* whose) {
  const auto found = counts.find(name);
  if (found == counts.end() || found->second < limit) return absl::OkStatus();
  return TooManyStreamsError(whose, limit);
}

void GiveBack(std::map<std::string, size_t>& counts, const std::string& name) {
  const auto found = counts.find(name);
  if (found != counts.end() && --found->second == 0) counts.erase(found);
}

}  // namespace

StreamOwner OwnerOf(const Caller& caller, const CallOrigin& origin) {
  StreamOwner owner;
  if (!caller.sees_all_projects) owner.project = caller.project;
  // All callers of a gateway come from its address, so the subject counts.
  if (!caller.subject.empty()) {
    owner.peer = absl::StrCat(caller.project, "/", caller.subject);
  } else if (absl::StartsWith(origin.peer, "ipv")) {  // "ipv4:127.0.0.1:50051"
    owner.peer = origin.peer.substr(0, origin.peer.rfind(':'));
  }
  return owner;
}

StreamRegistry::StreamRegistry(absl::Duration tick, const StreamLimits& limits)
    : tick_(tick), limits_(limits), thread_([this] { Tick(); }) {}

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
    status = MayWaitLocked();
    // Refused streams are added too, so that their Remove has an entry.
    streams_[stream.get()].stream = stream;
    if (!status.ok()) ++num_refused_;
  }
  // Without the mutex: End finishes the call, and gRPC's reaction calls Remove. The refused stream
  // is in the list until then.
  if (!status.ok()) stream->End(status);
}

absl::Status StreamRegistry::MayWaitLocked() const {
  if (!end_status_.ok()) return end_status_;
  if (draining_) return DrainingError();
  return streams_.size() - num_admitted_ < kMaxUnknown
             ? absl::OkStatus()
             : TooManyStreamsError("the server", kMaxUnknown);
}

absl::Status StreamRegistry::MayOpenLocked(const StreamOwner& owner) const {
  if (num_admitted_ >= limits_.max_streams) {
    return TooManyStreamsError("the server", limits_.max_streams);
  }
  // An empty name has no entry, and thus no limit.
  RETURN_IF_ERROR(CheckBound(by_project_, owner.project, limits_.max_per_project, "the project"));
  return CheckBound(by_peer_, owner.peer, limits_.max_per_peer, "this client");
}

absl::Status StreamRegistry::Admit(Stream* stream, const StreamOwner& owner) {
  const std::lock_guard lock(mutex_);
  const auto found = streams_.find(stream);
  // Either would be an error of the stream: it would be counted twice, or never given back.
  if (found == streams_.end() || found->second.admitted) {
    return absl::InternalError("the stream is not waiting to be admitted");
  }
  if (absl::Status status = MayOpenLocked(owner); !status.ok()) {
    ++num_refused_;
    return status;
  }
  found->second.admitted = true;
  found->second.owner = owner;
  CountLocked(owner);
  return absl::OkStatus();
}

void StreamRegistry::CountLocked(const StreamOwner& owner) {
  WarnLocked("the server", ++num_admitted_, limits_.max_streams);
  if (!owner.project.empty()) {
    WarnLocked("project " + owner.project, ++by_project_[owner.project], limits_.max_per_project);
  }
  if (!owner.peer.empty()) {
    WarnLocked("client " + owner.peer, ++by_peer_[owner.peer], limits_.max_per_peer);
  }
}

void StreamRegistry::WarnLocked(const std::string& whose, size_t count, size_t limit) {
  // Warns from four fifths of the limit on, at most once a minute.
  if (count * 5 < limit * 4) return;
  const absl::Time now = absl::Now();
  if (now - last_warning_ < kStreamWarningInterval) return;
  last_warning_ = now;
  spdlog::warn("streams: {} has {} open, at {} more are refused", whose, count, limit);
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
  const auto found = streams_.find(stream);
  if (found == streams_.end()) return;
  if (found->second.admitted) {
    --num_admitted_;
    GiveBack(by_project_, found->second.owner.project);
    GiveBack(by_peer_, found->second.owner.peer);
  }
  streams_.erase(found);
}

void StreamRegistry::EndAll(const absl::Status& status) {
  std::vector<std::shared_ptr<Stream>> streams;
  {
    const std::lock_guard lock(mutex_);
    end_status_ = status;
    // Collected here and ended below, without the mutex: End finishes the call, and gRPC's reaction
    // calls Remove.
    for (const auto& [address, entry] : streams_) streams.push_back(entry.stream.lock());
  }
  for (const auto& stream : streams) {
    if (stream != nullptr) stream->End(status);
  }
}

size_t StreamRegistry::size() const {
  const std::lock_guard lock(mutex_);
  return streams_.size();
}

// Wakes a sixteenth of the streams at a time, so that queries need not wait for all of them to
// work.
void StreamRegistry::Tick() {
  constexpr uintptr_t kParts = 16;
  constexpr uintptr_t kSpread = 64;  // bytes, less than any stream takes
  uintptr_t part = 0;
  std::unique_lock lock(mutex_);
  while (!stop_.wait_for(lock, absl::ToChronoMicroseconds(tick_ / kParts),
                         [this] { return stopping_; })) {
    part = (part + 1) % kParts;
    std::vector<std::shared_ptr<Stream>> streams;
    for (const auto& [address, entry] : streams_) {
      const auto place = reinterpret_cast<uintptr_t>(address) / kSpread;
      if (place % kParts == part) streams.push_back(entry.stream.lock());
    }
    lock.unlock();
    for (const auto& stream : streams) {
      if (stream != nullptr) stream->Tick();
    }
    streams.clear();  // may destroy streams, which must not happen under the mutex
    lock.lock();
  }
}

}  // namespace pepeseg
