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

}  // namespace pepeseg
