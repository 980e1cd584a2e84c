#include "server/store/quota.h"

#include "absl/strings/str_cat.h"
#include "server/store/error_detail.h"

namespace pepeseg {

Quota InForce(const Quota& own, const Quota& server) {
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

absl::Status QuotaError(const std::string& name, int64_t need, int64_t limit) {
  // Not private, unlike the database's RESOURCE_EXHAUSTED for a full disk: callers tell the two
  // apart by that.
  return WithDetail(
      absl::ResourceExhaustedError(absl::StrCat(
          "the project's quota of ", name, " is ", limit, ", this would make it ", need,
          "; delete what is not needed, or ask the server's operator for a higher "
          "quota")),
      {.reason = "QUOTA",
       .field = name,
       .limit = absl::StrCat(limit),
       .value = absl::StrCat(need)});
}

}  // namespace pepeseg
