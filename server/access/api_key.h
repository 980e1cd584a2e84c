#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "pepeseg/v1/access.pb.h"
#include "server/store/records.h"

namespace pepeseg {

// A new key. The secret is returned to whoever asked for the key, and is stored nowhere.
struct NewKey {
  KeyRecord record;    // id and sha256 only
  std::string secret;  // "pk_" and 256 random bits, as web-safe base64
};

// Makes a key from the system's random bits. INTERNAL: the system has none.
absl::StatusOr<NewKey> MakeKey();

// Returns whether `secret` has the form of MakeKey's secrets.
bool LooksLikeSecret(const std::string& secret);
// Returns the SHA-256 of a secret, 64 lower-case hex digits.
std::string DigestOfSecret(const std::string& secret);
// Compares in constant time, which does not reveal where the two differ.
bool SameDigest(const std::string& a, const std::string& b);

inline bool IsExpired(const KeyRecord& key, absl::Time now) {
  return key.expire_time != absl::InfinitePast() && key.expire_time <= now;
}
inline bool IsRevoked(const KeyRecord& key) { return key.revoke_time != absl::InfinitePast(); }

// Bits of KeyRecord::scopes.
inline int ScopeBit(v1::Scope scope) { return 1 << static_cast<int>(scope); }
inline int AllScopes() {
  return ScopeBit(v1::SCOPE_READ) | ScopeBit(v1::SCOPE_WRITE) | ScopeBit(v1::SCOPE_TRAIN) |
         ScopeBit(v1::SCOPE_OPERATE);
}
// Reads a list such as "read,write,train,operate". INVALID_ARGUMENT: it is empty, or a word is not
// a scope.
absl::StatusOr<int> ScopesFromText(const std::string& text);
std::string ScopesToText(int scopes);

}  // namespace pepeseg
