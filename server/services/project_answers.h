#pragma once

#include <string>

#include "absl/status/status.h"
#include "pepeseg/v1/api_key.pb.h"
#include "pepeseg/v1/quota.pb.h"
#include "server/access/project_quotas.h"
#include "server/services/model_loader.h"
#include "server/store/store.h"

namespace pepeseg {

// Answers AdminService's calls about projects: their keys, quotas and usage. All of them block on
// the store. Quotas and models must outlive it.
class ProjectAnswers {
 public:
  ProjectAnswers(ProjectQuotas& quotas, const ModelLoader& models)
      : quotas_(quotas), models_(models), store_(models.store()) {}

  absl::Status CreateKey(const v1::CreateKeyRequest& request,
                         v1::CreateKeyResponse* response) const;
  absl::Status GetKey(const v1::GetKeyRequest& request, v1::ApiKey* response) const;
  absl::Status ListKeys(const v1::ListKeysRequest& request, v1::ListKeysResponse* response) const;
  absl::Status RevokeKey(const v1::RevokeKeyRequest& request, v1::ApiKey* response) const;
  absl::Status GetProjectUsage(const v1::GetProjectUsageRequest& request,
                               v1::ProjectUsage* response) const;
  absl::Status UpdateQuota(const v1::UpdateQuotaRequest& request, v1::ProjectUsage* response) const;

 private:
  absl::Status FillUsage(const std::string& project, v1::ProjectUsage* response) const;

  ProjectQuotas& quotas_;
  const ModelLoader& models_;
  Store& store_;
};

}  // namespace pepeseg
