#pragma once

#include "absl/status/status.h"
#include "pepeseg/v1/api_key.pb.h"
#include "server/store/store.h"

// AdminService's answers about keys. All of them block on the store.
namespace pepeseg {

absl::Status AnswerCreateKey(Store& store, const v1::CreateKeyRequest& request,
                             v1::CreateKeyResponse* response);
absl::Status AnswerListKeys(Store& store, const v1::ListKeysRequest& request,
                            v1::ListKeysResponse* response);
absl::Status AnswerRevokeKey(Store& store, const v1::RevokeKeyRequest& request,
                             v1::ApiKey* response);

}  // namespace pepeseg
