#include "server/services/project_answers.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/access/api_key.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/records_to_proto.h"
#include "server/api/resource_name.h"

namespace pepeseg {
namespace {

constexpr std::string_view kCollection = "keys/";
// Hex digits of a key's id; the secret is not part of it.
constexpr size_t kIdLength = 16;

v1::ApiKey KeyToProto(const KeyRecord& record) {
  v1::ApiKey key;
  key.set_name(absl::StrCat("keys/", record.id));
  key.set_project(record.project);
  key.set_display_name(record.display_name);
  for (int scope = v1::SCOPE_READ; scope <= v1::SCOPE_OPERATE; ++scope) {
    if ((record.scopes & ScopeBit(static_cast<v1::Scope>(scope))) != 0) {
      key.add_scopes(static_cast<v1::Scope>(scope));
    }
  }
  *key.mutable_create_time() = ToProto(record.create_time);
  if (record.expire_time != absl::InfinitePast())
    *key.mutable_expire_time() = ToProto(record.expire_time);
  if (record.revoke_time != absl::InfinitePast())
    *key.mutable_revoke_time() = ToProto(record.revoke_time);
  return key;
}

absl::StatusOr<int> ScopesFromProto(const v1::CreateKeyRequest& request) {
  int scopes = 0;
  for (int i = 0; i < request.scopes_size(); ++i) {
    const auto scope = static_cast<v1::Scope>(request.scopes(i));
    if (scope < v1::SCOPE_READ || scope > v1::SCOPE_OPERATE) {
      return BadField(absl::StrCat("scopes[", i, "]"), absl::StrCat(static_cast<int>(scope)),
                      "no scope");
    }
    scopes |= ScopeBit(scope);
  }
  if (scopes == 0) return BadField("scopes", "", "at least one is needed");
  return scopes;
}

absl::StatusOr<absl::Time> ExpiryFromProto(const v1::CreateKeyRequest& request) {
  // The store's value for a key that does not expire.
  if (!request.has_expire_time()) return absl::InfinitePast();
  using google::protobuf::util::TimeUtil;
  const auto& asked = request.expire_time();
  const absl::Time time = absl::FromUnixSeconds(asked.seconds()) + absl::Nanoseconds(asked.nanos());
  if (time > absl::Now() && asked.seconds() <= TimeUtil::kTimestampMaxSeconds) return time;
  return BadField("expire_time", absl::FormatTime(time, absl::UTCTimeZone()),
                  "not a time in the future");
}

absl::StatusOr<std::string> ParseKeyName(const std::string& name) {
  const std::string id = name.substr(std::min(name.size(), kCollection.size()));
  const bool is_hex = std::all_of(id.begin(), id.end(), [](char c) {
    return absl::ascii_isdigit(c) || (c >= 'a' && c <= 'f');
  });
  if (name.starts_with(kCollection) && id.size() == kIdLength && is_hex) return id;
  return BadField("name", name, "not of the form keys/{16 hex digits}");
}

void QuotaToProto(const Quota& quota, v1::Quota* proto) {
  proto->set_stored_bytes(quota.stored_bytes);
  proto->set_open_uploads(quota.open_uploads);
  proto->set_queued_jobs(quota.queued_jobs);
  proto->set_running_jobs(quota.running_jobs);
  proto->set_queries_per_second(quota.queries_per_second);
  proto->set_resident_bytes(quota.resident_bytes);
}

absl::StatusOr<Quota> QuotaFromProto(const v1::Quota& proto) {
  // Checks all fields by reflection, so that a new one is not forgotten. All of them are int64.
  const google::protobuf::Descriptor& type = *v1::Quota::descriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const int64_t value = proto.GetReflection()->GetInt64(proto, type.field(i));
    if (value >= 0) continue;
    return BadField("quota." + type.field(i)->name(), absl::StrCat(value), "negative");
  }
  return Quota{proto.stored_bytes(), proto.open_uploads(),       proto.queued_jobs(),
               proto.running_jobs(), proto.queries_per_second(), proto.resident_bytes()};
}

}  // namespace

absl::Status ProjectAnswers::CreateKey(const v1::CreateKeyRequest& request,
                                       v1::CreateKeyResponse* response) const {
  RETURN_IF_ERROR(CheckProject(request.project(), "project"));
  RETURN_IF_ERROR(CheckDisplayName(request.display_name(), "display_name"));
  ASSIGN_OR_RETURN(const int scopes, ScopesFromProto(request));
  ASSIGN_OR_RETURN(const absl::Time expire_time, ExpiryFromProto(request));
  ASSIGN_OR_RETURN(NewKey key, MakeKey());
  key.record.project = request.project();
  key.record.display_name = request.display_name();
  key.record.scopes = scopes;
  key.record.expire_time = expire_time;
  ASSIGN_OR_RETURN(const KeyRecord made, store_.keys().CreateKey(key.record));
  *response->mutable_key() = KeyToProto(made);
  // The only time that the secret is sent: the store has its digest.
  response->set_secret(key.secret);
  return absl::OkStatus();
}

absl::Status ProjectAnswers::GetKey(const v1::GetKeyRequest& request, v1::ApiKey* response) const {
  ASSIGN_OR_RETURN(const std::string id, ParseKeyName(request.name()));
  const auto key = store_.keys().GetKey(id);
  if (!key.ok()) return WithResource(key.status(), "NO_SUCH_KEY", request.name());
  *response = KeyToProto(*key);
  return absl::OkStatus();
}

absl::Status ProjectAnswers::ListKeys(const v1::ListKeysRequest& request,
                                      v1::ListKeysResponse* response) const {
  if (!request.project().empty()) RETURN_IF_ERROR(CheckProject(request.project(), "project"));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<KeyRecord> keys, store_.keys().ListKeys(request.project(), page));
  for (const KeyRecord& record : keys.records) *response->add_keys() = KeyToProto(record);
  response->set_next_page_token(keys.next_page_token);
  return absl::OkStatus();
}

absl::Status ProjectAnswers::RevokeKey(const v1::RevokeKeyRequest& request,
                                       v1::ApiKey* response) const {
  ASSIGN_OR_RETURN(const std::string id, ParseKeyName(request.name()));
  const auto key = store_.keys().RevokeKey(id);
  if (!key.ok()) return WithResource(key.status(), "NO_SUCH_KEY", request.name());
  *response = KeyToProto(*key);
  return absl::OkStatus();
}

absl::Status ProjectAnswers::FillUsage(const std::string& project,
                                       v1::ProjectUsage* response) const {
  ASSIGN_OR_RETURN(const Quota quota, quotas_.Get(project));
  ASSIGN_OR_RETURN(Quota used, store_.quotas().GetUsage(project));
  // Queries and memory are counted by this server, not by the store, so they are this server's
  // share only.
  used.queries_per_second = quotas_.QueryRate(project);
  used.resident_bytes = models_.devices().BytesOf(project);
  response->set_project(project);
  QuotaToProto(quota, response->mutable_quota());
  QuotaToProto(used, response->mutable_used());
  return absl::OkStatus();
}

absl::Status ProjectAnswers::GetProjectUsage(const v1::GetProjectUsageRequest& request,
                                             v1::ProjectUsage* response) const {
  RETURN_IF_ERROR(CheckProject(request.project(), "project"));
  return FillUsage(request.project(), response);
}

absl::Status ProjectAnswers::UpdateQuota(const v1::UpdateQuotaRequest& request,
                                         v1::ProjectUsage* response) const {
  RETURN_IF_ERROR(CheckProject(request.project(), "project"));
  ASSIGN_OR_RETURN(const Quota quota, QuotaFromProto(request.quota()));
  RETURN_IF_ERROR(store_.quotas().SetProjectQuota(request.project(), quota).status());
  // This server applies the new quota at once; others do when their copy expires.
  quotas_.Forget(request.project());
  return FillUsage(request.project(), response);
}

}  // namespace pepeseg
