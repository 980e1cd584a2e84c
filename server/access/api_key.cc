#include "server/access/api_key.h"

#include <openssl/crypto.h>
#include <sys/random.h>

#include <array>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "core/base/digest.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kPrefix = "pk_";
constexpr size_t kSecretBytes = 32;
constexpr size_t kIdBytes = 8;
// "pk_" and the secret in base64 without padding.
constexpr size_t kSecretLength = 3 + (kSecretBytes * 4 + 2) / 3;

// By v1::Scope.
constexpr absl::string_view kScopeWords[] = {"", "read", "write", "train", "operate"};

}  // namespace

absl::StatusOr<NewKey> MakeKey() {
  std::array<char, kSecretBytes + kIdBytes> bytes;
  // The secret and the id are independent, so the id, which logs show, says nothing about the
  // secret.
  if (getentropy(bytes.data(), bytes.size()) != 0) {
    return absl::InternalError("the system gives no random bits for a key");
  }
  const absl::string_view random(bytes.data(), bytes.size());
  NewKey key;
  key.secret = absl::StrCat(kPrefix, absl::WebSafeBase64Escape(random.substr(0, kSecretBytes)));
  key.record.id = absl::BytesToHexString(random.substr(kSecretBytes));
  key.record.sha256 = DigestOfSecret(key.secret);
  // Unlike memset, it is not optimised away.
  OPENSSL_cleanse(bytes.data(), bytes.size());
  return key;
}

bool LooksLikeSecret(const std::string& secret) {
  return secret.size() == kSecretLength && absl::StartsWith(secret, kPrefix);
}

// A plain SHA-256 suffices: 32 random bytes cannot be guessed, unlike a password.
std::string DigestOfSecret(const std::string& secret) { return Sha256Hex(secret); }

bool SameDigest(const std::string& a, const std::string& b) {
  // Takes the same time wherever the digests differ, so that the time reveals nothing.
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

absl::StatusOr<int> ScopesFromText(const std::string& text) {
  int scopes = 0;
  for (const absl::string_view word : absl::StrSplit(text, ',')) {
    int bit = 0;
    for (int scope = v1::SCOPE_READ; scope <= v1::SCOPE_OPERATE; ++scope) {
      if (word == kScopeWords[scope]) bit = ScopeBit(static_cast<v1::Scope>(scope));
    }
    if (bit == 0) {
      return absl::InvalidArgumentError(absl::StrCat(
          "scope '", word, "': must be read, write, train or operate; separate several by ','"));
    }
    scopes |= bit;
  }
  return scopes;
}

std::string ScopesToText(int scopes) {
  std::vector<absl::string_view> words;
  for (int scope = v1::SCOPE_READ; scope <= v1::SCOPE_OPERATE; ++scope) {
    if ((scopes & ScopeBit(static_cast<v1::Scope>(scope))) != 0) {
      words.push_back(kScopeWords[scope]);
    }
  }
  return absl::StrJoin(words, ",");
}

}  // namespace pepeseg
