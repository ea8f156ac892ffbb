#include "ctrl_more/states/handles.hpp"
#include <cstdio>
using namespace ctrl_more;
int main(){ double d[8]={0,0,0,0,0,0,0,0}; Numbers<> a(d,3); a.topRows(5).setConstant(9); printf("topRows(5) on 3: d[3]=%g d[4]=%g\n",d[3],d[4]);
 double e[8]={0}; Numbers<3> t(e,3); t << 1,2,3,4,5; printf("<< five on 3: e[3]=%g e[4]=%g\n",e[3],e[4]);
 double f[8]={0}; Numbers<3> u(f,3); u.coeffRef(4)=7; u.middleRows(2,3).setConstant(8); printf("coeffRef/middleRows: %g %g\n",f[3],f[4]); }
