#include "server/access/project_quotas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/access/method_access.h"
#include "server/store/error_detail.h"

namespace pepeseg {
namespace {

// Age at which Get reads a quota again.
constexpr absl::Duration kMaxAge = absl::Seconds(1);
// Age up to which AdmitAtOnce trusts what it knows. Longer than kMaxAge, so that a client that
// sends queries all the time never becomes unknown in between.
constexpr absl::Duration kMaxStale = absl::Seconds(2);
constexpr size_t kMaxOpened = 10'000;  // credentials that are remembered
// How the names of the methods begin whose calls are queries (see pepeseg.v1.Quota).
constexpr std::array kQueryMethods = {
    "pepeseg.v1.SegmentationService.",        "pepeseg.v1.LabelService.",
    "pepeseg.v1.SelectionService.",           "pepeseg.v1.RenderService.",
    "pepeseg.v1.EvaluationService.",          "pepeseg.v1.EditService.",
    "pepeseg.v1.DatasetService.GetPhotograph"};

bool IsQuery(const google::protobuf::Message& request) {
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  return access != nullptr &&
         std::any_of(kQueryMethods.begin(), kQueryMethods.end(),
                     [&](const char* start) { return absl::StartsWith(access->method, start); });
}

// `missing`: part of a token that is missing until the next query is admitted.
absl::Status TooFastError(double per_second, double missing) {
  // The time until the missing part of a token has been filled. Rounded up, so that a client that
  // waits for it is admitted.
  const auto milliseconds = static_cast<int64_t>(std::ceil(1000 * missing / per_second));
  const auto limit = static_cast<int64_t>(per_second);
  return WithDetail(
      absl::UnavailableError(absl::StrCat("the project's quota is ", limit,
                                          " queries per second; retry in ", milliseconds, " ms")),
      {.reason = "QUOTA",
       .field = "queries_per_second",
       .limit = absl::StrCat(limit),
       .value = absl::StrCat(limit + 1),
       .retry_after = absl::Milliseconds(milliseconds)});
}

}  // namespace

// The mutex is not held while the store is asked. Several threads may then read the same quota;
// that is harmless.
absl::StatusOr<Quota> ProjectQuotas::Get(const std::string& project) {
  const absl::Time now = absl::Now();
  {
    const std::lock_guard lock(mutex_);
    const auto known = projects_.find(project);
    if (known != projects_.end() && now - known->second.read < kMaxAge) return known->second.quota;
  }
  ASSIGN_OR_RETURN(const ProjectRecord record, store_->quotas().GetProject(project));
  const std::lock_guard lock(mutex_);
  Project& known = projects_[project];
  known.quota = InForce(record.quota, store_->default_quota());
  known.read = now;
  return known.quota;
}

void ProjectQuotas::Forget(const std::string& project) {
  const std::lock_guard lock(mutex_);
  projects_[project].read = absl::InfinitePast();
}

absl::Status ProjectQuotas::Admit(const std::string& project,
                                  const google::protobuf::Message& request) {
  if (!IsQuery(request)) return absl::OkStatus();
  ASSIGN_OR_RETURN(const Quota quota, Get(project));
  return AdmitQuery(project, static_cast<double>(quota.queries_per_second));
}

// Refuses a flood of queries cheaply: it costs a hash and two map lookups. A credential that was
// revoked less than kMaxStale ago may still be admitted here, but is then refused by Authorize.
std::optional<absl::Status> ProjectQuotas::AdmitAtOnce(const std::string& credential,
                                                       const google::protobuf::Message& request) {
  if (!IsQuery(request)) return std::nullopt;
  const absl::Time now = absl::Now();
  const std::lock_guard lock(mutex_);
  const auto opened = opened_.find(credential);
  if (opened == opened_.end() || now - opened->second.known > kMaxStale) return std::nullopt;
  const auto known = projects_.find(opened->second.project);
  if (known == projects_.end() || now - known->second.read > kMaxStale) return std::nullopt;
  return TakeToken(known->second, static_cast<double>(known->second.quota.queries_per_second), now);
}

void ProjectQuotas::Know(const std::string& credential, const std::string& project,
                         const google::protobuf::Message& request) {
  if (!IsQuery(request)) return;
  Get(project).status().IgnoreError();  // refreshes the cache; Admit reports errors
  const absl::Time now = absl::Now();
  const std::lock_guard lock(mutex_);
  // Simple and rare: those that are forgotten cost one look into the store each.
  if (opened_.size() >= kMaxOpened) opened_.clear();
  opened_[credential] = {project, now};
}

std::string ProjectQuotas::OwnerOf(const std::string& credential) {
  const std::lock_guard lock(mutex_);
  const auto opened = opened_.find(credential);
  return opened == opened_.end() ? absl::StrCat("credential/", credential) : opened->second.project;
}

absl::Status ProjectQuotas::AdmitQuery(const std::string& project, double per_second) {
  const std::lock_guard lock(mutex_);
  return TakeToken(projects_[project], per_second, absl::Now());
}

absl::Status ProjectQuotas::TakeToken(Project& known, double per_second, absl::Time now) {
  // A token bucket that holds the queries of one second. 0: unlimited, but counted.
  if (per_second > 0) {
    const double passed = absl::ToDoubleSeconds(now - known.filled);  // infinite the first time
    known.tokens = std::clamp(known.tokens + std::max(0.0, passed) * per_second, 0.0, per_second);
    known.filled = now;
    if (known.tokens < 1) return TooFastError(per_second, 1 - known.tokens);
    known.tokens -= 1;
  }
  TurnRing(known, now);
  ++known.admitted[known.newest_second % kSeconds];
  return absl::OkStatus();
}

// Seconds without a query become 0.
void ProjectQuotas::TurnRing(Project& project, absl::Time now) {
  const int64_t second = absl::ToUnixSeconds(now);
  const int64_t first = std::max(project.newest_second + 1, second - kSeconds + 1);
  for (int64_t s = first; s <= second; ++s) project.admitted[s % kSeconds] = 0;
  project.newest_second = std::max(project.newest_second, second);
}

int64_t ProjectQuotas::QueryRate(const std::string& project) {
  const std::lock_guard lock(mutex_);
  const auto known = projects_.find(project);
  if (known == projects_.end()) return 0;
  TurnRing(known->second, absl::Now());
  const auto& admitted = known->second.admitted;
  const int64_t sum = std::accumulate(admitted.begin(), admitted.end(), int64_t{0});
  // Rounded up, so that a single query is not reported as 0 per second.
  return (sum + kSeconds - 1) / kSeconds;
}

}  // namespace pepeseg
