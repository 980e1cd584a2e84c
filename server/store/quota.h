#pragma once

#include <cstdint>

namespace pepeseg {

// What a project may take, as pepeseg.v1.Quota tells it. In a server's options 0 is no limit, of a
// project the server's value.
struct Quota {
  int64_t stored_bytes = 0;
  int64_t open_uploads = 0;
  int64_t queued_jobs = 0;
  int64_t running_jobs = 0;
  int64_t queries_per_second = 0;
  int64_t resident_bytes = 0;
};

// What holds for a project: its own value of each, else the server's.
inline Quota InForce(const Quota& own, const Quota& server) {
  const auto pick = [](int64_t of_project, int64_t of_server) {
    return of_project > 0 ? of_project : of_server;
  };
  return {pick(own.stored_bytes, server.stored_bytes),
          pick(own.open_uploads, server.open_uploads),
          pick(own.queued_jobs, server.queued_jobs),
          pick(own.running_jobs, server.running_jobs),
          pick(own.queries_per_second, server.queries_per_second),
          pick(own.resident_bytes, server.resident_bytes)};
}

}  // namespace pepeseg
