#pragma once

#include <grpcpp/grpcpp.h>

#include <cstdint>
#include <string>

#include "absl/time/time.h"
#include "tests/server/running_server.h"

namespace pepeseg {

inline constexpr int kStreamsPerConnection = 200;  // the server's limit is 256

// A server in this process, asked over sockets, with a model in "shelf" and a job in "idle" that
// never ends. `worker`: model_worker.cc.
struct LoadedServer {
  explicit LoadedServer(const std::string& worker);

  v1::ServerStatus Status();
  // How many it tells of, once there are so many, or after 30 s.
  int AwaitStreams(int want);
  // Of a gauge or counter without labels that it exposes.
  double Metric(const std::string& name);

  RunningServer running;
  std::string idle_job;
};

// Many watchers of a job that tells nothing, and questions meanwhile, `num_ways` at a time.
struct WatchersReport {
  int64_t num_queries = 0, num_failed = 0;
  absl::Duration p99_without, p99_with;
  int num_streams = 0;  // that the server told of
  // Of the process: the server's, and gRPC's own for the client; before there were watchers, too.
  int num_threads_without = 0, num_threads = 0;
  int pool_threads = 0;  // those of them that are the server's pools
};
WatchersReport RunWatchers(LoadedServer& server, int num_watchers, absl::Duration duration);

// Questions that take long, first as many as keep the server busy, then `factor` times as many as
// it answered.
struct OverloadReport {
  double peak_per_second = 0, goodput_per_second = 0, offered_per_second = 0;
  int64_t num_refused = 0, num_failed = 0;  // failed: neither answered nor refused
  absl::Duration refusal_p50;
  bool all_told_when_to_retry = true;
};
OverloadReport RunOverload(LoadedServer& server, double factor, absl::Duration duration);

// Calls given up at once, streams and questions by turns.
struct CancelsReport {
  int64_t num_cancelled = 0;
  int64_t rss_before = 0, rss_after = 0;
  int num_streams = 0;         // left
  double calls_in_flight = 0;  // left
};
CancelsReport RunCancels(LoadedServer& server, int num_calls);

// Streams of which nobody reads.
struct UnreadReport {
  int64_t rss_before = 0, rss_with = 0;
  int num_streams = 0, num_streams_after = 0;
};
UnreadReport RunUnread(LoadedServer& server, int num_streams);

// Exports of some of a large model of which nobody reads.
struct UnreadExportsReport {
  int num_streams = 0, num_streams_after = 0;
  int64_t export_bytes = 0;  // of one of them
  int64_t rss_before = 0, rss_with = 0;
  double reserved_before = 0, reserved_with = 0, reserved_after = 0;  // of the memory budget
};
UnreadExportsReport RunUnreadExports(LoadedServer& server, int num_streams);

// As many streams as the server takes, and one more.
struct CrowdReport {
  int num_streams = 0, num_streams_after = 0;
  grpc::Status beyond;     // how that one ended
  grpc::Status meanwhile;  // of a call that is no stream
};
CrowdReport RunCrowd(LoadedServer& server, int num_streams);

}  // namespace pepeseg
