// A scene in space that can be rotated; report/svg/panel.rs draws the same.
const SVG='http://www.w3.org/2000/svg';
function node(parent,name,attributes,text){
  const n=document.createElementNS(SVG,name);
  for(const[k,v]of Object.entries(attributes))n.setAttribute(k,v);
  if(text!==undefined)n.textContent=text;
  parent.append(n);return n;
}
class SceneView{
  constructor(figure,panel,host,high){
    this.figure=figure;this.panel=panel;this.host=host;this.scene=panel.marks[0].scene;this.high=high;
    this.yaw=.7;this.pitch=.35;this.size=1;this.hidden=new Set();
    this.svg=node(host,'svg',{role:'img','aria-label':figure.title+': drag or arrow keys turn it'});
    this.svg.classList.add('turned');
    this.svg.addEventListener('pointerdown',e=>{
      this.svg.setPointerCapture(e.pointerId);
      let[x,y]=[e.clientX,e.clientY];
      const move=m=>{this.turn((m.clientX-x)*.01,(m.clientY-y)*.01);[x,y]=[m.clientX,m.clientY]};
      const up=()=>{this.svg.removeEventListener('pointermove',move);this.svg.removeEventListener('pointerup',up)};
      this.svg.addEventListener('pointermove',move);this.svg.addEventListener('pointerup',up);
    });
    this.svg.addEventListener('wheel',e=>{
      if(!e.ctrlKey&&!host.closest('figure').contains(document.activeElement))return;
      e.preventDefault();this.zoom(e.deltaY<0?1.15:1/1.15);
    },{passive:false});
    this.svg.addEventListener('dblclick',()=>this.whole());
    new ResizeObserver(()=>this.redraw()).observe(host);
    this.redraw();
  }
  turn(yaw,pitch){this.yaw+=yaw;this.pitch=Math.max(-1.55,Math.min(1.55,this.pitch+pitch));this.redraw()}
  zoom(by){this.size=Math.max(.2,Math.min(20,this.size*by));this.redraw()}
  whole(){this.yaw=.7;this.pitch=.35;this.size=1;this.redraw()}
  along(axis){[this.yaw,this.pitch]=axis==='x'?[0,0]:axis==='y'?[0,1.55]:[Math.PI/2,0];this.redraw()}
  key(e){
    const act={ArrowLeft:()=>this.turn(-.1,0),ArrowRight:()=>this.turn(.1,0),ArrowUp:()=>this.turn(0,.1),ArrowDown:()=>this.turn(0,-.1),'+':()=>this.zoom(1.2),'-':()=>this.zoom(1/1.2),0:()=>this.whole(),x:()=>this.along('x'),y:()=>this.along('y'),z:()=>this.along('z')}[e.key];
    if(act)act();
    return!!act;
  }
  seen([x,y,z]){
    const cy=Math.cos(this.yaw),sy=Math.sin(this.yaw),cp=Math.cos(this.pitch),sp=Math.sin(this.pitch);
    const right=z*cy-x*sy,near=z*sy+x*cy;
    return[right,-(y*cp-near*sp),y*sp+near*cp];
  }
  // where a spot moves in a mode
  moved(s){return s.moves?s.at.map((v,i)=>v+s.moves[i]):s.at}
  corners(b){return Array.from({length:8},(_,i)=>[0,1,2].map(a=>i>>a&1?b.high[a]:b.low[a]))}
  redraw(){
    const w=this.host.clientWidth||600,h=this.high||Math.max(320,Math.min(460,.8*w)),svg=this.svg;
    svg.replaceChildren();
    svg.setAttribute('viewBox',`0 0 ${w} ${h}`);
    this.paint({
      line:(a,b,role,width)=>node(svg,'line',{x1:a[0].toFixed(1),y1:a[1].toFixed(1),x2:b[0].toFixed(1),y2:b[1].toFixed(1),class:role==='frame'?role:'s-'+role,'stroke-width':width}),
      dot:(p,role)=>node(svg,'circle',{cx:p[0],cy:p[1],r:4,class:`f-${role} s-${role}`}),
      square:(p,role)=>node(svg,'rect',{x:p[0]-4,y:p[1]-4,width:8,height:8,class:`paper s-${role}`,'stroke-width':1.4}),
      text:(x,y,text,anchor,size)=>node(svg,'text',{x:x.toFixed(1),y:y.toFixed(1),class:size>12?'label':'tick','text-anchor':anchor},text),
    },w,h);
    this.drawn=(this.drawn||0)+1;
  }
  // displaced position of a point of arm A (side 1) or B (side −1) when the arms move against one
  // another
  displaced(p,side,reach){
    const m=this.motion;
    if(!m||!side)return p;
    const[x,y,z,rx,ry,rz]=m,by=.5*side*(this.swing??1),turn=.5,[a,b,c]=p;
    return[a+by*(.35*reach*x+turn*(ry*c-rz*b)),b+by*(.35*reach*y+turn*(rz*a-rx*c)),c+by*(.35*reach*z+turn*(rx*b-ry*a))];
  }
  // draws everything with a pen of four strokes, on a sheet of w × h px
  paint(pen,w,h){
    const side=role=>/-a$/.test(role)?1:/-b$/.test(role)?-1:0;
    const all=[...this.scene.bodies.flatMap(b=>this.corners(b)),...this.scene.spots.flatMap(s=>[s.at,this.moved(s)])].map(p=>this.seen(p));
    const ends=i=>[Math.min(...all.map(p=>p[i])),Math.max(...all.map(p=>p[i]))];
    const[left,right]=ends(0),[top,bottom]=ends(1),reach=.5*Math.max(1e-3,Math.hypot(right-left,bottom-top));
    // leave space for names next to the outermost positions, and for moving arms
    const size=this.size*Math.min((w-(this.scene.spots.length?120:60))/Math.max(right-left,1e-3),(h-40)/Math.max(bottom-top,1e-3))*(this.scene.spots.length?1:.8);
    const at=(p,role)=>{const s=this.seen(this.displaced(p,side(role),reach));return[w/2+size*(s[0]-(left+right)/2),h/2+size*(s[1]-(top+bottom)/2),s[2]]};
    for(const b of this.scene.bodies){
      const c=this.corners(b).map(p=>at(p,b.role));
      for(let i=0;i<8;i++)for(const bit of[1,2,4])if(!(i&bit))pen.line(c[i],c[i|bit],b.role,.7);
    }
    for(const[name,d]of[['x',[1,0,0]],['y',[0,1,0]],['z',[0,0,1]]]){
      const s=this.seen(d),o=[46,h-46],e=[o[0]+34*s[0],o[1]+34*s[1]];
      pen.line(o,e,'frame',1.4);pen.text(e[0]+4*Math.sign(s[0]),e[1]-4,name,'middle',13);
    }
    const taken=[];
    const spots=[...this.scene.spots].map(s=>[s,at(s.at,s.role)]).sort((a,b)=>a[1][2]-b[1][2]);
    for(const[s,p]of spots){
      if(s.toward)pen.line(at(s.at.map((v,i)=>v-.014*s.toward[i]),s.role),p,s.role,2);
      if(s.moves){const tip=at(this.moved(s),s.role);pen.line(p,tip,s.role,2);pen.dot(tip,s.role)}
      if(s.toward)pen.dot(p,s.role);
      else pen.square(p,s.role);
    }
    for(const[s,p]of[...spots].reverse()){
      const width=6.8*[...s.name].length;
      const free=[[7,-5],[7,14],[-7-width,-5],[-7-width,14],[7,-17],[7,26]].map(d=>[p[0]+d[0],p[1]+d[1]]).find(([x,y])=>x>0&&x+width<w&&taken.every(t=>x+width<t[0]||x>t[2]||y+2<t[1]||y-12>t[3]));
      if(!free)continue;
      taken.push([free[0],free[1]-12,free[0]+width,free[1]+2]);
      pen.text(free[0],free[1],s.name,'start',12);
    }
  }
}
// the pen of a scene within an SVG file
const SCENE_HIGH=420;
const scenePen=(pen,x,y)=>{
  const colour=role=>role==='frame'?'#888888':look(role).colour,to=p=>[p[0]+x,p[1]+y];
  return{
    line:(a,b,role,width)=>pen.path([to(a),to(b)],{colour:colour(role),width,dash:''}),
    dot:(p,role)=>pen.circle(...to(p),4,colour(role),colour(role)),
    square:(p,role)=>pen.square(...to(p),4,'paper',colour(role)),
    text:(a,b,text,anchor,size)=>pen.text(a+x,b+y,text,anchor,'ink',size),
  };
};
