"""Speed along a blended path: the paper's profile, the limit-aware one, the feed override."""
