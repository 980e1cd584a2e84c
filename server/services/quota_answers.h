#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/quota.pb.h"
#include "server/rpc/service_context.h"

// AdminService's answers about quotas. Both block on the store.
namespace pepeseg {

absl::Status AnswerGetProjectUsage(const ServiceContext& context,
                                   const v1::GetProjectUsageRequest& request,
                                   v1::ProjectUsage* response);
absl::Status AnswerSetQuota(const ServiceContext& context, const v1::SetQuotaRequest& request,
                            v1::ProjectUsage* response);

}  // namespace pepeseg
