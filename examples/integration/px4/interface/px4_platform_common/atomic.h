#pragma once
namespace px4 {
template <typename T>
class atomic {
  public:
    explicit atomic(T value) : _value(value) {}
    T load() const { return __atomic_load_n(&_value, __ATOMIC_SEQ_CST); }
    void store(T value) { __atomic_store_n(&_value, value, __ATOMIC_SEQ_CST); }

  private:
    T _value;
};
}  // namespace px4
