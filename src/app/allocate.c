// Memory of the library. The linker puts these allocations, those of any statement of Fortran, in the place of the
// system's.
#include <stdlib.h>

void *__real_malloc(size_t bytes);
void *__real_calloc(size_t count, size_t bytes);
void *__real_realloc(void *before, size_t bytes);
void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t count, size_t bytes);
void *__wrap_realloc(void *before, size_t bytes);

// Of the executable; other programs that load the library have none.
__attribute__((weak)) void thud_end_without_memory(size_t bytes);

static void *require(void *place, size_t bytes)
{
   if (!place && bytes > 0 && thud_end_without_memory) thud_end_without_memory(bytes);
   return place;
}

void *__wrap_malloc(size_t bytes)
{
   return require(__real_malloc(bytes), bytes);
}

void *__wrap_calloc(size_t count, size_t bytes)
{
   return require(__real_calloc(count, bytes), count*bytes);
}

void *__wrap_realloc(void *before, size_t bytes)
{
   return require(__real_realloc(before, bytes), bytes);
}
