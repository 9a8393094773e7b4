! Arrays that no stack holds go into the structs, and out of them; ends with 0 where they do.
program large
  use, intrinsic :: iso_c_binding, only: c_double
  use fclib
  implicit none
  integer, parameter :: m = 1500000
  type(fclib_local) :: problem
  type(fclib_solution) :: solution
  integer, allocatable :: i(:), starts(:)
  real(c_double), allocatable :: x(:), dense(:, :)
  integer :: k
  allocate (i(m), starts(m + 1), x(m), dense(3, m))
  do k = 1, m
    i(k) = k
    starts(k) = k
    x(k) = k
    dense(:, k) = k
  end do
  starts(m + 1) = m + 1
  call fclib_set_triplets(problem%W, m, m, i, i, x)
  call stored
  call fclib_set_columns(problem%W, m, m, starts, i, x)
  call stored
  call fclib_set_rows(problem%W, m, m, starts, i, x)
  call stored
  call fclib_allocate(solution, problem)
  call fclib_set_dense(problem%V, dense)
  call fclib_get_triplets(problem%V, i, starts, x)
  if (i(3 * m) /= 3 .or. starts(3 * m) /= m .or. x(3 * m) /= m) stop 1
  call fclib_delete(solution)
  call fclib_delete(problem)

contains

  subroutine stored
    call fclib_get_triplets(problem%W, i, starts, x)
    if (i(m) /= m .or. starts(m) /= m .or. x(m) /= m) stop 1
    deallocate (starts)
    allocate (starts(m + 1))
    do k = 1, m + 1
      starts(k) = k
    end do
  end subroutine

end program
