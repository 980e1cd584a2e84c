#include "server/services/quota_answers.h"

#include <google/protobuf/descriptor.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"

namespace pepeseg {
namespace {

void QuotaToProto(const Quota& quota, v1::Quota* proto) {
  proto->set_stored_bytes(quota.stored_bytes);
  proto->set_open_uploads(quota.open_uploads);
  proto->set_queued_jobs(quota.queued_jobs);
  proto->set_running_jobs(quota.running_jobs);
  proto->set_queries_per_second(quota.queries_per_second);
  proto->set_resident_bytes(quota.resident_bytes);
}

absl::StatusOr<Quota> QuotaFromProto(const v1::Quota& proto) {
  const google::protobuf::Descriptor& type = *v1::Quota::descriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const int64_t value = proto.GetReflection()->GetInt64(proto, type.field(i));
    if (value >= 0) continue;
    return BadField("quota." + type.field(i)->name(), absl::StrCat(value), "negative");
  }
  return Quota{proto.stored_bytes(), proto.open_uploads(),       proto.queued_jobs(),
               proto.running_jobs(), proto.queries_per_second(), proto.resident_bytes()};
}

absl::Status FillUsage(const ServiceContext& context, const std::string& project,
                       v1::ProjectUsage* response) {
  ASSIGN_OR_RETURN(const Quota quota, context.quotas->Get(project));
  ASSIGN_OR_RETURN(Quota used, context.store->quotas().GetUsage(project));
  used.queries_per_second = context.quotas->QueryRate(project);
  used.resident_bytes = context.models->BytesOf(project);
  response->set_project(project);
  QuotaToProto(quota, response->mutable_quota());
  QuotaToProto(used, response->mutable_used());
  return absl::OkStatus();
}

}  // namespace

absl::Status AnswerGetProjectUsage(const ServiceContext& context,
                                   const v1::GetProjectUsageRequest& request,
                                   v1::ProjectUsage* response) {
  RETURN_IF_ERROR(CheckProject(request.project(), "project"));
  return FillUsage(context, request.project(), response);
}

absl::Status AnswerSetQuota(const ServiceContext& context, const v1::SetQuotaRequest& request,
                            v1::ProjectUsage* response) {
  RETURN_IF_ERROR(CheckProject(request.project(), "project"));
  ASSIGN_OR_RETURN(const Quota quota, QuotaFromProto(request.quota()));
  RETURN_IF_ERROR(context.store->quotas().SetProjectQuota(request.project(), quota).status());
  context.quotas->Forget(request.project());
  return FillUsage(context, request.project(), response);
}

}  // namespace pepeseg
