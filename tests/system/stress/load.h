#pragma once

#include <grpcpp/grpcpp.h>

#include <cstdint>
#include <string>

#include "absl/time/time.h"
#include "tests/server/running_server.h"

namespace pepeseg {

inline constexpr int kStreamsPerConnection = 200;  // the server's limit is 256

// A server in this process that is called over sockets, with a model in scene "shelf" and a job in
// scene "idle" that never ends. `worker`: path of model_worker.cc's program.
struct LoadedServer {
  explicit LoadedServer(const std::string& worker);

  v1::ServerStatus Status();
  // Waits up to 30 s until the server reports `want` streams, and returns the number.
  int AwaitStreams(int want);
  // Waits up to 5 s until no thread of a pool has anything to do.
  void AwaitIdlePools();
  // Returns the value of a gauge or counter without labels.
  double Metric(const std::string& name);

  RunningServer running;
  std::string idle_job;
};

// Queries, 64 at a time, in rounds: in each round for `phase` without watchers, then for `phase`
// with `num_watchers` watchers of a job without events. Other load thus slows both down.
struct WatchersReport {
  int64_t num_queries = 0, num_failed = 0;
  absl::Duration p50_without, p50_with, p99_without, p99_with;  // over all rounds
  // CPU seconds of the process a second without queries, with watchers less without.
  double watchers_cpu = 0;
  double p50_ratio = 0;  // median of the rounds' ratios of medians, with to without watchers
  int num_streams = 0;   // number of streams that the server reported
  // Threads of the process without and with watchers, without those that gRPC starts: how many
  // those are depends on the load.
  int num_threads_without = 0, num_threads = 0;
  int pool_threads = 0;  // threads of the server's pools
};
WatchersReport RunWatchers(LoadedServer& server, int num_watchers, int num_rounds,
                           absl::Duration phase);

// Slow queries: first as many as keep the server busy, then `factor` times as many as it answered.
struct OverloadReport {
  double peak_per_second = 0, goodput_per_second = 0, offered_per_second = 0;
  int64_t num_refused = 0, num_failed = 0;  // failed: neither answered nor refused
  absl::Duration refusal_p50;
  bool all_had_a_retry_time = true;
};
OverloadReport RunOverload(LoadedServer& server, double factor, absl::Duration duration);

// Calls that are cancelled at once, streams and queries in turn.
struct CancelsReport {
  int64_t num_cancelled = 0;
  int64_t rss_before = 0, rss_after = 0;
  int num_streams = 0;         // streams left at the end
  double calls_in_flight = 0;  // calls left at the end
};
CancelsReport RunCancels(LoadedServer& server, int num_calls);

// Streams that the client does not read.
struct UnreadReport {
  int64_t rss_before = 0, rss_with = 0;
  int num_streams = 0, num_streams_after = 0;
};
UnreadReport RunUnread(LoadedServer& server, int num_streams);

// Exports of a part of a large model that the client does not read.
struct UnreadExportsReport {
  int num_streams = 0, num_streams_after = 0;
  int64_t export_bytes = 0;  // size of one export
  int64_t rss_before = 0, rss_with = 0;
  double reserved_before = 0, reserved_with = 0, reserved_after = 0;  // bytes of the memory budget
};
UnreadExportsReport RunUnreadExports(LoadedServer& server, int num_streams);

// As many streams as the server accepts, and one more.
struct CrowdReport {
  int num_streams = 0, num_streams_after = 0;
  grpc::Status beyond;     // status of that one
  grpc::Status meanwhile;  // status of a unary call meanwhile
};
CrowdReport RunCrowd(LoadedServer& server, int num_streams);

}  // namespace pepeseg
