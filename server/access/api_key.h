#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "pepeseg/v1/access.pb.h"
#include "server/store/rows.h"

namespace pepeseg {

// A key as it is made. The secret is told to who asked for it and then forgotten.
struct NewKey {
  KeyRow row;          // id and sha256 only
  std::string secret;  // "pk_" and 256 random bits, as web-safe base64
};

// INTERNAL: the system has no random bits.
absl::StatusOr<NewKey> MakeKey();

// Whether it could be one that MakeKey has made.
bool LooksLikeSecret(const std::string& secret);
std::string DigestOfSecret(const std::string& secret);  // 64 lower-case hex digits
// In a time that does not tell where they differ.
bool SameDigest(const std::string& a, const std::string& b);

inline bool IsExpired(const KeyRow& key, absl::Time now) {
  return key.expire_time != absl::InfinitePast() && key.expire_time <= now;
}
inline bool IsRevoked(const KeyRow& key) { return key.revoke_time != absl::InfinitePast(); }

// KeyRow::scopes.
inline int ScopeBit(v1::Scope scope) { return 1 << static_cast<int>(scope); }
inline int AllScopes() {
  return ScopeBit(v1::SCOPE_READ) | ScopeBit(v1::SCOPE_WRITE) | ScopeBit(v1::SCOPE_TRAIN) |
         ScopeBit(v1::SCOPE_OPERATE);
}
// "read,write,train,operate" or some of them. INVALID_ARGUMENT: none, or a word that is no scope.
absl::StatusOr<int> ScopesFromText(const std::string& text);
std::string ScopesToText(int scopes);

}  // namespace pepeseg
