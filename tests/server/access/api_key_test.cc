#include "server/access/api_key.h"

#include <gtest/gtest.h>

#include <set>

#include "absl/time/clock.h"
#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(ApiKey, StoresOnlyTheDigestOfItsSecret) {
  std::set<std::string> secrets, ids;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_OK_AND_ASSIGN(const auto key, MakeKey());
    EXPECT_TRUE(LooksLikeSecret(key.secret)) << key.secret;
    EXPECT_EQ(key.record.sha256, DigestOfSecret(key.secret));
    EXPECT_EQ(key.record.sha256.size(), 64u);
    EXPECT_EQ(key.record.id.size(), 16u);
    EXPECT_EQ(key.secret.find(key.record.id), std::string::npos);
    secrets.insert(key.secret);
    ids.insert(key.record.id);
  }
  EXPECT_EQ(secrets.size(), 1000u);
  EXPECT_EQ(ids.size(), 1000u);
  EXPECT_FALSE(LooksLikeSecret("pk_short"));
  EXPECT_FALSE(LooksLikeSecret(""));
}

TEST(ApiKey, ComparesWholeDigests) {
  const std::string digest = DigestOfSecret("pk_a");
  EXPECT_TRUE(SameDigest(digest, DigestOfSecret("pk_a")));
  EXPECT_FALSE(SameDigest(digest, DigestOfSecret("pk_b")));
  EXPECT_FALSE(SameDigest(digest, digest.substr(1)));
}

TEST(ApiKey, ReadsAndWritesScopes) {
  EXPECT_EQ(*ScopesFromText("read"), ScopeBit(v1::SCOPE_READ));
  EXPECT_EQ(*ScopesFromText("read,write,train,operate"), AllScopes());
  EXPECT_EQ(ScopesToText(*ScopesFromText("train,read")), "read,train");
  for (const char* bad : {"", "read,", "all", "READ", "read write"}) {
    EXPECT_EQ(ScopesFromText(bad).status().code(), absl::StatusCode::kInvalidArgument) << bad;
  }
}

TEST(ApiKey, ExpiresAtItsTime) {
  KeyRecord key;
  const absl::Time now = absl::Now();
  EXPECT_FALSE(IsExpired(key, now));
  EXPECT_FALSE(IsRevoked(key));
  key.expire_time = now;
  EXPECT_TRUE(IsExpired(key, now));
  EXPECT_FALSE(IsExpired(key, now - absl::Microseconds(1)));
}

}  // namespace
}  // namespace pepeseg
